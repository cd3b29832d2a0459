"""Page section with the ablation of effects for a detector."""

from __future__ import annotations

from cosim.report import section, signed, table
from cosim.report.html import fill
from cosim.variants.worth import Interval, Worth


def detector_section(worth: Worth | None) -> str:
    """HTML of the section; empty without a result.

    Args:
        worth: results of the ablation.
    """
    if worth is None:
        return ""
    order = sorted(worth.effects, key=lambda result: -abs(result.change))
    rows = [["the drive’s own scans", f"{worth.measured:.1f}", "", ""]]
    rows.append(
        ["the model’s scans", f"{worth.model:.1f}", *_change(worth.gap, worth.gap_ci95, "against the drive’s own")]
    )
    for result in order:
        cells = _change(result.change, result.ci95, _verdict(result.change, result.ci95))
        rows.append([f"without {result.effect}", f"{result.ap:.1f}", *cells])
    text = fill(
        "{}, of the detector <code>{}</code> on {:,} frames with {:,} scored objects. The scans are "
        "simulated with the complete model, then without one effect at a time; the labels are the same. "
        "Changes are relative to the complete model, with 95 % confidence intervals from a bootstrap "
        "over frames. The effect with the largest change matters most to this detector.",
        worth.scored,
        worth.detector,
        worth.frames,
        worth.objects,
    )
    return section(
        "Average precision without each effect", table(["", "AP", "change", ""], rows, words=(3,)), text=text
    )


def _change(value: float, bounds: Interval, words: str) -> list[str]:
    low, high = bounds
    return [fill("{} <small>{} – {}</small>", signed(value), signed(low), signed(high)), words]


def _verdict(change: float, bounds: Interval) -> str:
    if not any(round(value, 1) for value in (change, *bounds)):
        return "no difference"
    return "significant" if bounds[0] > 0 or bounds[1] < 0 else "not significant"

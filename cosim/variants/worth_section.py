"""What effects are worth to a detector, as a part of pages."""

from __future__ import annotations

from html import escape

from cosim.report import section, signed, table
from cosim.variants.worth import Interval, Worth


def worth_section(worth: Worth | None) -> str:
    """HTML; empty where no detector was asked.

    Args:
        worth: what a detector finds without each effect.
    """
    if worth is None:
        return ""
    order = sorted(worth.effects, key=lambda one: -abs(one.change))
    rows = [["the drive’s own scans", f"{worth.measured:.1f}", "", ""]]
    rows.append(
        ["the model’s scans", f"{worth.model:.1f}", *_change(worth.gap, worth.gap_ci95, "against the drive’s own")]
    )
    for one in order:
        told = _change(one.change, one.ci95, _verdict(one.change, one.ci95))
        rows.append([f"without {escape(one.effect)}", f"{one.ap:.1f}", *told])
    text = (
        f"{escape(worth.scored)}, of the detector <code>{escape(worth.detector)}</code> on {worth.frames:,} frames "
        f"with {worth.objects:,} objects that count. Their twins are measured by the whole model, then without one "
        "effect at a time; the labels stay. Changes are against the whole model, frame by frame, with 95 % of draws of "
        "the frames: what changes most matters most to this detector."
    )
    return section(
        "What each effect is worth to a detector", table(["", "AP", "change", ""], rows, words=(3,)), text=text
    )


def _change(value: float, bounds: Interval, words: str) -> list[str]:
    low, high = bounds
    return [f"{signed(value)} <small>{signed(low)} – {signed(high)}</small>", words]


def _verdict(change: float, bounds: Interval) -> str:
    if not any(round(value, 1) for value in (change, *bounds)):
        return "makes no difference"
    return "more than chance" if bounds[0] > 0 or bounds[1] < 0 else "may be chance"

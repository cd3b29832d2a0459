"""The page of several drives: what differs between them, what they give together, whether each is recommended."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from cosim.discrepancy.words import Vocabulary
from cosim.recordings.calibration.drives import Drives
from cosim.recordings.calibration.estimates import Combined
from cosim.report import document, facts, figure, section, table
from cosim.report.html import fill
from cosim.report.phrases import p_cell
from cosim.report.plot import Axis, Plot

_MOST_ROWS = 40
_AGREE = 0.05


def headline(drives: Drives) -> str:
    """The outcome in a sentence or two, plain text."""
    differing = [one for one in drives.differences if one.is_significant]
    names = list(dict.fromkeys(f"{one.effect} {one.parameter}" for one in differing))
    count = len(drives.names)
    if not drives.differences:
        message = f"{count} drives share no parameter that could be compared."
    elif differing:
        shown = ", ".join(names[:4]) + (" and others" if len(names) > 4 else "")
        message = f"{len(differing)} of {len(drives.differences)} numbers differ significantly between drives: {shown}."
    else:
        message = f"None of {len(drives.differences)} numbers differs significantly between {count} drives."
    if drives.is_recommended:
        return f"{message} All drives confirm the combined file on held-out scans: it is recommended."
    kept = [
        name for name, one in zip(drives.names, drives.calibrations, strict=True) if not one.acceptance.is_recommended
    ]
    return f"{message} Keep your file: held-out scans of {', '.join(kept)} do not confirm it."


def format_comparison(drives: Drives) -> str:
    """The HTML text."""
    title = "Comparison of " + ", ".join(drives.names)
    return document(
        title,
        [
            fill("<header><h1>{}</h1><p class='verdict'>{}</p>{}</header>", title, headline(drives), _facts(drives)),
            section("What differs", _differences(drives), text=_TEXT),
            section("Together", _charts(drives), _combined(drives), text=_TOGETHER),
            section("Drive by drive", _drives(drives)),
        ],
        generator="cosim calibrate",
    )


_TEXT = (
    "Second drive less first, with its 95 % interval; p is family-wise over everything compared (Holm). "
    "Elevations are those that the points of each drive show."
)
_TOGETHER = (
    "Means over the drives with 95 % intervals that include the spread between drives; p is the probability that "
    "drives with one true value would differ as much (Cochran's Q)."
)


def _facts(drives: Drives) -> str:
    items = [("Drives", f"{len(drives.names)}"), ("Numbers compared", f"{len(drives.differences)}")]
    for name, one in zip(drives.names[1:], drives.directions, strict=True):
        if one is not None:
            items.append((f"Ray direction, {name}", f"{one.mean_deg:.4f}° mean, {one.max_deg:.4f}° largest"))
    return facts(items)


def _differences(drives: Drives) -> str:
    rows = [
        [
            _named(one.effect, one.parameter, one.row),
            f"{one.drives[0]} → {one.drives[1]}",
            f"{one.difference:+.4g} ({one.low:+.4g} to {one.high:+.4g}){_unit(one.effect, one.parameter)}",
            p_cell(one.p_value),
            "differs" if one.is_significant else "",
        ]
        for one in drives.differences[:_MOST_ROWS]
    ]
    if not rows:
        return Markup("<p>No parameter was estimated in two drives.</p>")
    rest = len(drives.differences) - len(rows)
    more = fill("<p>{} more differ less.</p>", rest) if rest > 0 else ""
    return table(["parameter", "drives", "difference", "p", ""], rows, words=(0, 1, 2, 4)) + more


def _combined(drives: Drives) -> str:
    rows = []
    for one in drives.combined:
        if one.effect == "pattern" or one.row is not None:
            continue
        by_drive = [
            "–" if value is None else f"{value:.4g} ({low:.4g} to {high:.4g})"
            for value, low, high in zip(one.values, one.low, one.high, strict=True)
        ]
        together = f"{one.mean:.4g} ({one.mean_low:.4g} to {one.mean_high:.4g}){_unit(one.effect, one.parameter)}"
        agree = "one drive" if one.p_agree is None else p_cell(one.p_agree)
        rows.append([_named(one.effect, one.parameter, None), *by_drive, together, agree])
    if not rows:
        return Markup("<p>No plain number was estimated; lists with a number a laser are in the sensor file.</p>")
    heads = ["parameter", *drives.names, "together", "p of agreement"]
    return table(heads, rows, words=range(len(heads) - 1))


def _charts(drives: Drives) -> str:
    plain = [one for one in drives.combined if one.row is None and sum(value is not None for value in one.values) > 1]
    return fill('<div class="charts">{}</div>', Markup().join(_chart(drives, one) for one in plain[:6]))


def _chart(drives: Drives, one: Combined) -> str:
    ends = np.array([value for value in (*one.low, *one.high, one.mean_low, one.mean_high) if value is not None])
    pad = 0.1 * float(np.ptp(ends)) or 0.1 * abs(float(ends[0])) or 1.0
    names = ["", *drives.names]
    unit = _unit(one.effect, one.parameter).strip()
    plot = Plot(
        Axis(0.5, len(drives.names) + 0.5, "", names=names),
        Axis(float(ends.min()) - pad, float(ends.max()) + pad, f"{one.parameter} [{unit}]" if unit else one.parameter),
        one.effect,
    )
    for position, (value, low, high) in enumerate(zip(one.values, one.low, one.high, strict=True), 1):
        if value is not None:
            plot.line(np.array([position, position], float), np.array([low, high], float), "a")
            plot.line(np.array([position], float), np.array([value], float), "a", dots=True)
    both = np.array([0.5, len(drives.names) + 0.5])
    plot.line(both, np.full(2, one.mean), "b")
    text = "each drive with its 95 % interval (yellow), mean of all (blue)"
    return figure(_named(one.effect, one.parameter, None), text, plot.svg())


def _drives(drives: Drives) -> str:
    rows = [
        [
            fill('<a href="{}/index.html">{}</a>', name, name),
            "yes" if one.acceptance.is_recommended else "no",
            one.acceptance.reason,
            f"{1000 * one.rounds[0].thickness_ground_m:.1f} → {1000 * one.rounds[-1].thickness_ground_m:.1f}",
        ]
        for name, one in zip(drives.names, drives.calibrations, strict=True)
    ]
    return table(["drive", "recommended", "because", "ground [mm]"], rows, words=(0, 1, 2, 3))


def _named(effect: str, parameter: str, row: int | None) -> str:
    laser = "" if row is None else f", laser {row + 1}"
    return f"{'beam pattern' if effect == 'pattern' else effect}, {parameter}{laser}"


def _unit(effect: str, parameter: str) -> str:
    unit = "°" if effect == "pattern" else Vocabulary().parameter(effect, parameter).unit
    return f" {unit}" if unit else ""

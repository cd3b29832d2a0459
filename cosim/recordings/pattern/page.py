"""The page of a pattern: lasers, their steps, their fan, how well points lie on them."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from cosim.recordings.pattern.find import FoundPattern
from cosim.report import document, facts, figure, notes_section, section, table
from cosim.report.html import fill
from cosim.report.plot import Axis, Plot, nice_top


def format_page(pattern: FoundPattern, title: str) -> str:
    """The HTML text.

    Args:
        pattern: pattern to report.
        title: plain text.
    """
    lasers = pattern.lasers
    head = fill(
        "<header><h1>{}</h1><p class='verdict'>{} lasers from {:+.2f}° to {:+.2f}°, {} firings/turn; "
        "{:.1%} of the points lie on a laser's cone.</p>{}</header>",
        title,
        len(lasers),
        lasers.elevation_deg[0],
        lasers.elevation_deg[-1],
        pattern.turning.firings,
        lasers.share,
        _facts(pattern),
    )
    charts = Markup().join(
        (_elevations(pattern), _spacing(pattern), _misfit(pattern), _fan(pattern), _centres(pattern), _share(pattern))
    )
    parts = [
        head,
        section("What the points show", fill('<div class="charts">{}</div>', charts)),
        notes_section(pattern.notes, "What to know"),
        section("Lasers", _table(pattern)),
    ]
    return document(title, parts, generator="cosim pattern")


def _facts(pattern: FoundPattern) -> str:
    lasers, turning = pattern.lasers, pattern.turning
    firings = f"{turning.firings}" if turning.fixed else f"{turning.firings} ± {turning.firings_sd:.1f}"
    return facts(
        [
            ("Scans looked at", f"{pattern.scans}"),
            ("Points", f"{pattern.points:,}"),
            ("On a beam", f"{lasers.share:.2%}"),
            ("Spread about it, median", f"{np.median(lasers.misfit_deg):.4f}°"),
            ("Standard error of elevations, largest", f"{max(lasers.elevation_sd_deg.max(), 5e-5):.4f}°"),
            ("Firings a turn", firings),
            ("Azimuth step", f"{360 / max(turning.firings, 1):.4f}°"),
            ("Sweep", f"{pattern.pattern.sweep_s:g} s"),
            ("Order of points", turning.order),
            ("Fan known from", turning.fan_known),
        ]
    )


def _rings(pattern: FoundPattern) -> Axis:
    return Axis(-0.5, len(pattern.lasers) - 0.5, "laser, top first")


def _elevations(pattern: FoundPattern) -> str:
    values = pattern.lasers.elevation_deg
    plot = Plot(_rings(pattern), Axis(*_padded(values), "elevation [°]"), "elevations by laser")
    plot.line(np.arange(len(values)), values, "a", dots=True)
    return figure("Elevation", "of each laser", plot.svg())


def _spacing(pattern: FoundPattern) -> str:
    gap = -np.diff(pattern.lasers.elevation_deg)
    if not len(gap):
        return ""
    plot = Plot(_rings(pattern), Axis(0, nice_top(float(gap.max())), "to the next laser [°]"), "spacing of lasers")
    plot.line(np.arange(len(gap)) + 0.5, gap, "b", dots=True)
    return figure(
        "Spacing",
        "between neighbours; an even sensor shows a level line, a laser that was missed a doubled step",
        plot.svg(),
    )


def _misfit(pattern: FoundPattern) -> str:
    misfit, error = pattern.lasers.misfit_deg, pattern.lasers.elevation_sd_deg
    top = nice_top(1.2 * float(max(misfit.max(), error.max(), 1e-4)))
    plot = Plot(_rings(pattern), Axis(0, top, "[°]"), "misfit by laser")
    rows = np.arange(len(misfit))
    plot.line(rows, misfit, "a", dots=True)
    plot.line(rows, error, "c", dots=True)
    return figure(
        "Misfit", "spread of points about their cone (yellow), standard error of its elevation (green)", plot.svg()
    )


def _fan(pattern: FoundPattern) -> str:
    fan = np.array(pattern.pattern.azimuth_offset_deg, float)
    plot = Plot(_rings(pattern), Axis(*_padded(fan), "azimuth offset [°]"), "fan of the lasers")
    plot.line(np.arange(len(fan)), fan, "b", dots=True)
    known = {
        "within a step": "only its part of an azimuth step is known",
        "not at all": "not determined by these scans",
    }
    return figure("Fan", known.get(pattern.turning.fan_known, f"from {pattern.turning.fan_known}"), plot.svg())


def _centres(pattern: FoundPattern) -> str:
    centre = 100 * pattern.lasers.centre_m
    plot = Plot(_rings(pattern), Axis(*_padded(centre), "height of the centre [cm]"), "optical centres")
    plot.line(np.arange(len(centre)), centre, "a", dots=True)
    return figure("Optical centre", "of each laser along the axis; two levels are two blocks", plot.svg())


def _share(pattern: FoundPattern) -> str:
    points = pattern.lasers.points / max(pattern.scans, 1)
    plot = Plot(_rings(pattern), Axis(0, nice_top(float(points.max())), "points a scan"), "points by laser")
    plot.line(np.arange(len(points)), points, "b", dots=True)
    return figure("Points", f"of each laser; {pattern.turning.firings} would be every firing", plot.svg())


def _table(pattern: FoundPattern) -> str:
    lasers, fan = pattern.lasers, pattern.pattern.azimuth_offset_deg
    heads = ["laser", "elevation [°]", "±", "fan [°]", "centre [m]", "spread [°]", "points"]
    rows = (
        [
            str(row),
            f"{lasers.elevation_deg[row]:+.4f}",
            f"{lasers.elevation_sd_deg[row]:.4f}",
            f"{fan[row]:+.3f}",
            f"{lasers.centre_m[row]:+.4f}",
            f"{lasers.misfit_deg[row]:.4f}",
            f"{lasers.points[row]:,}",
        ]
        for row in range(len(lasers))
    )
    return fill("<details><summary>{} lasers</summary>{}</details>", len(lasers), table(heads, rows))


def _padded(values: np.ndarray) -> tuple[float, float]:
    low, high = float(np.min(values)), float(np.max(values))
    pad = 0.08 * (high - low) or 0.5
    return low - pad, high + pad

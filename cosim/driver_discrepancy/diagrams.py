"""Diagrams of traffic engineering: the fundamental diagram, and space and time on one street."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from cosim.driver_discrepancy.summary import Summary
from cosim.report import figure
from cosim.report.html import fill
from cosim.report.plot import Axis, Plot

_GAP_S = 3.0  # between samples of a vehicle, from which its line is interrupted


def draw_diagrams(measured: Summary, models: Sequence[tuple[str, Sequence[Summary]]]) -> str:
    """A section with the fundamental diagram, and a space–time diagram of the measurement and of each model.

    Args:
        measured: the measurement.
        models: names and simulations; the first simulation of each is drawn.
    """
    drawn = [("measured", "a", measured)]
    drawn += [(name, style, runs[0]) for style, (name, runs) in zip("bc", models, strict=False) if runs]
    rows = [_fundamental(drawn), [_space_time(name, style, one, measured) for name, style, one in drawn]]
    shown = [Markup().join(chart for chart in row if chart) for row in rows]
    if not any(shown):
        return ""
    words = (
        "Fundamental diagrams: one dot per street and 30 s, density and flow after Edie, all with the same axes. "
        f"Space–time diagrams: all lanes of {_street_words(measured)}, one line per vehicle, from the start of the "
        "street to its end; lines of different lanes may cross. Of each model the first seed is drawn."
    )
    swatches = Markup().join(
        fill('<span><i style="background:var(--{})"></i> {}</span>', style, name) for name, style, _ in drawn
    )
    legend = fill('<div class="legend" style="padding-left:0">{}</div>', swatches)
    charts = Markup().join(fill('<div class="charts">{}</div>', row) for row in shown if row)
    return fill("<section><h2>Flow, density, space and time</h2><p>{}</p>{}{}</section>", words, legend, charts)


def _street_words(measured: Summary) -> str:
    name = f"street {measured.street}, " if measured.street else ""
    return f"{name}on which most distance is driven"


def _fundamental(drawn: Sequence[tuple[str, str, Summary]]) -> list[str]:
    """A diagram of each, with the same axes."""
    points = [one.fundamental for _, _, one in drawn if len(one.fundamental)]
    if not points:
        return []
    top = np.concatenate(points).max(0) * 1.08
    axes = Axis(0, float(top[0]), "density [veh/km of lane]"), Axis(0, float(top[1]), "flow [veh/h of lane]")
    figures = []
    for name, style, one in drawn:
        title = f"Fundamental diagram, {name}"
        plot = Plot(*axes, title)
        for density, flow in one.fundamental.tolist():
            plot.line(np.array([density]), np.array([flow]), style, dots=True)
        figures.append(figure(title, "", plot.svg()))
    return figures


def _space_time(name: str, style: str, one: Summary, measured: Summary) -> str:
    if not len(measured.space_time):
        return ""
    length = float(measured.space_time[:, 2].max()) * 1.02
    title = f"Space–time diagram, {name}"
    plot = Plot(Axis(0, max(measured.seconds, 1.0), "time [s]"), Axis(0, length, "position [m]"), title)
    for vehicle in np.unique(one.space_time[:, 0]).tolist():
        rows = one.space_time[one.space_time[:, 0] == vehicle]
        cuts = np.flatnonzero(np.diff(rows[:, 1]) > _GAP_S) + 1
        for part in np.split(rows, cuts):
            if len(part) > 1:
                plot.line(part[:, 1], np.minimum(part[:, 2], length), style)
    return figure(title, "", plot.svg())

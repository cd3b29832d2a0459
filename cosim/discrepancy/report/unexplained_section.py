"""What no effect explains: unknown shapes, and what is still significant in the end with the residuals that show it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

import numpy as np

from cosim.discrepancy.budget import Judged
from cosim.discrepancy.diagnosis import Diagnosis
from cosim.discrepancy.report.beams import LAYOUT, Beams
from cosim.discrepancy.report.bins import USUAL, Bins, bins_of
from cosim.discrepancy.report.residual_charts import (
    CHANNELS,
    Channel,
    Chart,
    all_charts,
    chart,
    drawn,
    pair_chart,
    scale_of,
)
from cosim.discrepancy.report.scan_view import scan_view
from cosim.discrepancy.unexplained import Unexplained
from cosim.discrepancy.unknown.effect import Factor, UnknownEffect
from cosim.discrepancy.words import channel_words, table_words
from cosim.report import button, figure, legend, section, table
from cosim.report.phrases import p_cell
from cosim.report.plot import Axis, Plot


@dataclass(frozen=True, eq=False)
class Explored:
    """What a page shows of judged frames.

    Attributes:
        beams: of the frames.
        bins: of covariates, by name.
        charts: by channel.
    """

    beams: Beams
    bins: dict[str, Bins]
    charts: dict[str, list[Chart]]

    @classmethod
    def of(cls, judged: Judged | None, shown: int, more: Collection[str] = ()) -> Explored | None:
        """Of judged frames, `shown` of them whole; `more` names covariates beside the usual ones."""
        return None if judged is None else cls.of_beams(Beams.of(judged, shown), more)

    @classmethod
    def of_beams(cls, beams: Beams, more: Collection[str] = ()) -> Explored:
        """Of beams that have been gathered."""
        bins = bins_of(beams.rows, (*USUAL, *more))
        return cls(beams, bins, all_charts(beams.rows, bins, beams.is_one))

    @property
    def count(self) -> int:
        """How many charts there are."""
        return sum(len(charts) for charts in self.charts.values())

    @property
    def left(self) -> tuple[Chart, ...]:
        """Charts that show a dependence in the end, the surest first."""
        found = [one for charts in self.charts.values() for one in charts if one.shows(one.after, self.count)]
        return tuple(sorted(found, key=lambda one: one.after.p_value))


def explorer_section(found: Explored | None, sides: Sequence[str], *, text: str) -> str:
    """HTML; empty without frames.

    Args:
        found: what is shown.
        sides: words on before and after, as in legends.
        text: what was taken out of residuals (HTML).
    """
    if found is None or not found.charts:
        return ""
    told = sides[-1:] if found.beams.is_one else sides
    first = next(iter(found.charts))
    tabs = "".join(button(charts[0].channel.title, name == first, tab=name) for name, charts in found.charts.items())
    panels = "".join(_panel(charts, found.count, name == first) for name, charts in found.charts.items())
    colours = legend([(f"var(--{style})", escape(word)) for style, word in zip("ba"[-len(told) :], told, strict=True)])
    picks = f'<div class="picks" role="group" aria-label="channel">{tabs}</div>'
    left = f'<div class="residuals">{picks}{colours}{panels}</div>'
    right = scan_view(found.beams.scans, found.bins, told)
    body = f'<div class="explore">{left}{right}</div>'
    return section("Residuals, and the beams that they are of", body, text=text, anchor="residuals")


def _panel(charts: Sequence[Chart], count: int, is_shown: bool) -> str:
    top, channel = scale_of(charts), charts[0].channel
    figures = "".join(drawn(one, top, count) for one in charts)
    hidden = "" if is_shown else " hidden"
    return (
        f'<div data-panel="{channel.name}"{hidden}><p>{channel.signs} Those with most to tell first, one scale.</p>'
        f'<div class="charts">{figures}</div></div>'
    )


def explorer_style() -> str:
    """CSS of what `explorer_section` gives."""
    return "\n" + (files("cosim.discrepancy.report") / "explorer.css").read_text(encoding="utf-8")


def unexplained_section(found: tuple[Unexplained, ...], explored: Explored | None) -> str:
    """HTML; empty where nothing is left."""
    rows = [
        [escape(channel_words(one.channel)), escape(_on(one)), escape(size_words(one)), escape(p_cell(one.p_value))]
        for one in found
    ]
    listed = table(["what is off", "by", "size", "p"], rows, words=(1,))
    pictures = [_picture(one, explored) for one in found[: LAYOUT.unexplained]] if explored else []
    charts = f'<div class="charts">{"".join(pictures)}</div>' if any(pictures) else ""
    text = (
        "Still significant in the final model and explained by no finding above. p is family-wise: the probability "
        "that any hypothesis would look like this if nothing were missing. Charts show residuals of held-out frames."
    )
    return section("What is not explained", listed, charts, text=text if found else "", anchor="unexplained")


def size_words(one: Unexplained) -> str:
    """The root mean square of a dependence with its unit."""
    if not np.isfinite(one.size) or one.size == 0:
        return "–"
    if one.unit == "m":
        return f"{100 * one.size:.2g} cm"
    return f"{one.size:.2g}" if one.channel == "intensity" else f"{100 * one.size:.2g} %"


def _on(one: Unexplained) -> str:
    if one.resembles:
        return f"similar to {one.resembles}"
    return " and ".join(one.covariates).replace("_", " ")


def _picture(one: Unexplained, explored: Explored) -> str:
    """The residuals that are left, by what they depend on."""
    rows, title = explored.beams.rows, f"{channel_words(one.channel)}, {'' if one.resembles else 'by '}{_on(one)}"
    if one.channel not in CHANNELS:
        return ""
    title = title[0].upper() + title[1:]
    if one.covariates == ("noise_shape",):
        return figure(
            title, "What is left, beside a normal law of the same spread", _shape(explored, CHANNELS[one.channel])
        )
    if len(one.covariates) == 2:
        pair = [Bins.of(rows, name, LAYOUT.pair_bins) for name in one.covariates]
        if pair[0] is None or pair[1] is None:
            return ""
        body = pair_chart(rows, one.channel, pair[0], pair[1])
        return figure(title, "What is left, over both", body) if body else ""
    shown = _strongest(one, explored) if one.resembles else _chart(one, explored)
    return drawn(shown, scale_of([shown]), 1, title) if shown else ""


def _chart(one: Unexplained, explored: Explored) -> Chart | None:
    name = one.covariates[0] if one.covariates else ""
    bins = explored.bins.get(name) or bins_of(explored.beams.rows, (name,)).get(name)
    return None if bins is None else chart(explored.beams.rows, one.channel, bins, is_one=True)


def _strongest(one: Unexplained, explored: Explored) -> Chart | None:
    """Of what looks like an effect, the chart of its channel in which most is left."""
    return max(explored.charts.get(one.channel, ()), key=lambda chart: chart.after.size, default=None)


def _shape(explored: Explored, channel: Channel) -> str:
    """SVG: how residuals are distributed, over their spread, beside a normal law."""
    values = explored.beams.rows.after[channel.name].astype(float)
    values = values[np.isfinite(values)]
    middle = values - np.median(values)
    spread = 1.4826 * float(np.median(np.abs(middle))) or 1.0
    edges = np.linspace(-LAYOUT.sigmas, LAYOUT.sigmas, 65)
    share = np.histogram(middle / spread, edges)[0] / max(len(values), 1) / np.diff(edges)
    normal = np.exp(-(edges**2) / 2) / np.sqrt(2 * np.pi)
    top = 1.15 * max(float(share.max()), float(normal.max()))
    unit = f"1 is {channel.said(channel.factor * spread)}"
    over = Axis(-LAYOUT.sigmas, LAYOUT.sigmas, f"residual over its spread, {unit}")
    plot = Plot(over, Axis(0, top, "density"), "the noise's shape", 460, 270)
    plot.steps(edges, share, "a")
    plot.line(edges, normal, "b")
    return plot.svg()


_UNITS = {"m": " [m]", "rad": " [rad]"}


def unknown_section(found: Diagnosis) -> str:
    """HTML: formulas, fitted parameters, plug-ins and curves; empty where nothing is unknown."""
    if not found.unknowns:
        return ""
    return section("Effects that are in no catalogue", *(_unknown(unknown) for unknown in found.unknowns))


def _unknown(unknown: UnknownEffect) -> str:
    curve = unknown.curve
    fit = f"<p>The formula explains {unknown.r2:.1%} of the curve.</p>" if unknown.terms else ""
    parameters = ", ".join(_parameter(name, value, unknown.ci95.get(name)) for name, value in unknown.params.items())
    parameters = f"<p>Fitted together with everything else: {escape(parameters)}.</p>" if parameters else ""
    law = table_words(unknown) or unknown.form
    variables = f"<p>{escape(unknown.variables)}</p>" if unknown.variables else ""
    on = " and ".join(curve.covariates).replace("_", " ")
    head = f"{channel_words(curve.channel).capitalize()} depends on {on}:"
    charts = "".join(_chart_of(unknown, factor) for factor in unknown.factors)
    return (
        f'<p>{escape(head)}</p><p class="formula">{escape(law)}</p>{variables}{fit}{parameters}'
        f"<p>The improved sensor contains it as <code>{escape(unknown.name)}.py</code>: a plug-in to rename and edit "
        f"when its cause is known.</p>{charts}"
    )


def _parameter(name: str, value: float, interval: list[float] | None) -> str:
    words = f"{name} {value:.3g}".replace("-", "−")
    if interval is None:
        return words
    half = (interval[1] - interval[0]) / 2
    return f"{words} ± {half:.2g}" if np.isfinite(half) else f"{words} (interval cannot be determined)"


def _chart_of(unknown: UnknownEffect, factor: Factor) -> str:
    """The curve over one covariate with two standard errors, and the fitted term."""
    y, sigma = np.asarray(factor.y, float), np.asarray(factor.sigma, float)
    name, unit = factor.covariate.replace("_", " "), f" [{factor.unit}]" if factor.unit else ""
    known = np.isfinite(y) & np.isfinite(sigma)
    if not known.any():
        return ""
    if isinstance(factor.x, tuple):
        order = np.argsort(np.where(known, -np.abs(y / np.maximum(sigma, 1e-12)), 1.0), kind="stable")
        order = order[: min(LAYOUT.values, int(known.sum()))]
        x, y, sigma = np.arange(len(order), dtype=float), y[order], sigma[order]
        labels = [factor.x[row].replace("_", " ") for row in order]
        axis = Axis(-0.5, len(order) - 0.5, name, names=labels)
    else:
        x, y, sigma = np.asarray(factor.x, float)[known], y[known], sigma[known]
        axis = Axis(float(x.min()), float(x.max()) if np.ptp(x) > 0 else float(x.min()) + 1, f"{name}{unit}")
    low, high = float((y - 2 * sigma).min()), float((y + 2 * sigma).max())
    reach = max(high, 0.0) - min(low, 0.0) or 1e-9
    is_first = factor is unknown.factors[0] or factor.covariate == unknown.curve.covariates[0]
    channel_unit = _UNITS.get(unknown.curve.unit, "") if is_first else " (factor)"
    label = f"{channel_words(unknown.curve.channel)}{channel_unit}"
    upright = Axis(min(low, 0.0) - 0.15 * reach, max(high, 0.0) + 0.15 * reach, label)
    plot = Plot(axis, upright, f"{label} by {name}", 900, 320)
    plot.line(np.array([axis.low, axis.high]), np.zeros(2), "zero")
    if isinstance(factor.x, tuple):
        for place, level, side in zip(x, y, 2 * sigma, strict=True):
            plot.line(np.full(2, place), np.array([level - side, level + side]), "a")
        plot.line(x, y, "none", dots=True)
        text = "Measured change by category, with two standard errors."
    else:
        plot.band(x, y - 2 * sigma, y + 2 * sigma, "a")
        plot.line(x, y, "a", dots=True)
        fine = np.linspace(axis.low, axis.high, 300)
        plot.line(fine, factor.term.evaluate(fine), "b")
        text = "Dots: measured change by bin, with two standard errors. Blue: the fitted term."
    return figure("", text, plot.svg(), kind="full", width_px=900)

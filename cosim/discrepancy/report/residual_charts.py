"""Charts of residuals against covariates, before and after, whose bins can be selected in the scans."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.report.beams import LAYOUT, Rows
from cosim.discrepancy.report.bins import NO_BIN, Bins
from cosim.report import figure
from cosim.report.binned import Binned, binned
from cosim.report.plot import Axis, Plot


@dataclass(frozen=True)
class ResidualChannel:
    """Display of a channel's residuals.

    Attributes:
        name: name as in `diagnose --json`.
        title: title of the charts.
        factor, unit: factor from residuals to the displayed unit, and this unit.
        label: label of the axis.
        signs: meaning of the sign.
        clear: smallest relevant size in this unit.
    """

    name: str
    title: str
    factor: float
    unit: str
    label: str
    signs: str
    clear: float

    def text(self, size: float) -> str:
        """A size with its unit."""
        digits = 2 if self.unit == "cm" else 1 if self.unit else 4
        return f"{size:.{digits}f}{f' {self.unit}' if self.unit else ''}"


CHANNELS = {
    channel.name: channel
    for channel in (
        ResidualChannel("range", "Ranges", 100.0, "cm", "measured − model (cm)",
                "Above zero: measured farther than the model.", 0.1),
        ResidualChannel("intensity", "Intensities", 1.0, "", "measured − model",
                "Above zero: measured brighter than the model.", 0.003),
        ResidualChannel("drop", "Returns", 100.0, "%", "returned − expected (%)",
                "Below zero: the model predicts returns that are missing.", 0.3),
        ResidualChannel("spurious", "Spurious returns", 1000.0, "‰", "spurious − expected (‰ of beams)",
                "Above zero: more spurious returns than the model predicts.", 0.3),
        ResidualChannel("range_variance", "Spread of ranges", 100.0, "%", "variance beyond the model’s (%)",
                "Above zero: ranges scatter more than the model predicts.", 5.0),
        ResidualChannel("intensity_variance", "Spread of intensities", 100.0, "%", "variance beyond the model’s (%)",
                "Above zero: intensities scatter more than the model predicts.", 5.0),
    )
}  # fmt: skip
USUAL_CHANNELS = ("range", "intensity", "drop", "spurious")
_OF_SPURIOUS = (
    "ring",
    "azimuth",
    "firing_time",
    "frame_time",
)  # spurious returns have no surface with range or material


@dataclass(frozen=True, eq=False)
class ResidualChart:
    """One channel by one covariate.

    Attributes:
        channel: channel of the residuals.
        bins: bins of the covariate.
        before, after: means by bin, in the channel's unit; `before` is None if both are the same.
    """

    channel: ResidualChannel
    bins: Bins
    before: Binned | None
    after: Binned

    @property
    def first(self) -> Binned:
        """Means before, or the only ones."""
        return self.before or self.after


def all_charts(rows: Rows, bins: Mapping[str, Bins], is_one: bool) -> dict[str, list[ResidualChart]]:
    """Charts of every covariate by channel, the largest first; without channels that are absent."""
    found: dict[str, list[ResidualChart]] = {}
    for name in USUAL_CHANNELS:
        wanted = [item for item in bins.values() if name != "spurious" or item.name in _OF_SPURIOUS]
        candidates = (build_chart(rows, name, item, is_one) for item in wanted)
        charts = [item for item in candidates if item is not None]
        if charts:
            near = LAYOUT.tie_share * max(max(item.first.size, item.after.size) for item in charts) or 1.0
            # At constant rotation speed azimuth and firing time are equivalent; charts of equal size keep their order.
            found[name] = sorted(charts, key=lambda item: -round(max(item.first.size, item.after.size) / near))
    return found


def build_chart(rows: Rows, channel: str, bins: Bins, is_one: bool) -> ResidualChart | None:
    """Build the chart of a channel by a covariate; None with fewer than two bins."""
    kind = CHANNELS[channel]
    values = rows.covariates[bins.name].values
    bin_of_row = np.where(bins.of_rows == NO_BIN, 0, bins.of_rows).astype(int)

    def means(residual: np.ndarray, cluster: np.ndarray) -> Binned:
        values_of_rows = np.where(bins.of_rows == NO_BIN, np.nan, kind.factor * residual.astype(float))
        return binned(np.nan_to_num(values), bin_of_row, values_of_rows, cluster, rows.settings.coverage, LAYOUT.fewest)

    after = means(rows.after[channel], rows.cluster)
    if len(after.bin) < 2:
        return None
    before = None if is_one else means(rows.before[channel], rows.before_cluster)
    before = before if before is not None and len(before.bin) > 1 else None
    return ResidualChart(kind, bins, before, after)


def scale_of(charts: Sequence[ResidualChart]) -> float:
    """Common scale of all charts of a channel; at least three times the smallest relevant size."""
    reach = []
    for item in charts:
        for side in (item.first, item.after):
            common = side.count >= LAYOUT.common * side.count.sum()
            mean = np.abs(side.mean[common]).max(initial=0.0)
            half = float(np.quantile(np.nan_to_num(side.half), 0.9))
            reach.append(float(mean + min(half, mean)))
    return 1.1 * max([*reach, 3 * charts[0].channel.clear])


def draw_chart(chart: ResidualChart, top: float) -> str:
    """HTML of a chart with its caption."""
    return figure(f"by {chart.bins.shown.words.split(',')[0]}", _caption(chart), _svg(chart, top))


def _caption(chart: ResidualChart) -> str:
    """Root mean squares of the means of the bins, without their noise."""
    after = chart.channel.text(chart.after.size)
    return f"±{after}" if chart.before is None else f"±{chart.channel.text(chart.before.size)} → ±{after}"


def _svg(chart: ResidualChart, top: float) -> str:
    bins, channel = chart.bins, chart.channel
    sides = [(style, side) for style, side in (("b", chart.before), ("a", chart.after)) if side is not None]
    if bins.names:
        return _of_names(chart, sides, top)
    factor = bins.shown.factor
    places = factor * np.concatenate([side.place for _, side in sides])
    pad = 0.02 * max(float(np.ptp(places)), 1e-6)
    x = Axis(float(places.min()) - pad, float(places.max()) + pad, bins.label)
    plot = Plot(x, Axis(-top, top, channel.label), f"{channel.title} by {bins.shown.words}", 460, 270)
    plot.line(np.array([x.low, x.high]), np.zeros(2), "zero")
    for style, side in sides:
        half = np.nan_to_num(side.half)
        plot.band(factor * side.place, side.mean - half, side.mean + half, style)
        plot.line(factor * side.place, side.mean, style, dots=len(side.mean) <= LAYOUT.dots)
    _targets(plot, chart, _ends(bins, x))
    return plot.svg()


def _of_names(chart: ResidualChart, sides: Sequence[tuple[str, Binned]], top: float) -> str:
    bins, channel = chart.bins, chart.channel
    kept = sides[-1][1].bin.tolist()
    words = [bins.words()[number] for number in kept]
    slots = {number: position for position, number in enumerate(kept)}
    x = Axis(-0.5, len(kept) - 0.5, bins.label, names=[_brief(word, len(words)) for word in words])
    plot = Plot(x, Axis(-top, top, channel.label), f"{channel.title} by {bins.shown.words}", 460, 270)
    plot.line(np.array([x.low, x.high]), np.zeros(2), "zero")
    aside = 0.12 if len(sides) > 1 else 0.0
    for (style, side), shift in zip(sides, (-aside, aside), strict=False):
        rows = [row for row, number in enumerate(side.bin.tolist()) if number in slots]
        for row in rows:
            position, half = slots[int(side.bin[row])] + shift, float(np.nan_to_num(side.half[row]))
            ends = np.array([side.mean[row] - half, side.mean[row] + half])
            plot.line(np.full(2, position), ends, style)
            plot.line(np.array([position]), side.mean[row : row + 1], style, dots=True)
    ends = {number: (position - 0.5, position + 0.5) for number, position in slots.items()}
    _targets(plot, chart, ends)
    return plot.svg()


def _ends(bins: Bins, x: Axis) -> dict[int, tuple[float, float]]:
    """Interval of each bin on the axis, in the displayed unit."""
    if len(bins.codes):
        return {row: (float(code) - 0.5, float(code) + 0.5) for row, code in enumerate(bins.codes)}
    edges = np.clip(np.concatenate([[-np.inf], bins.shown.factor * bins.edges, [np.inf]]), x.low, x.high)
    return {row: (float(edges[row]), float(edges[row + 1])) for row in range(len(bins))}


def _targets(plot: Plot, chart: ResidualChart, ends: Mapping[int, tuple[float, float]]) -> None:
    """Add a clickable strip over each bin that shows its beams."""
    words = chart.bins.words()
    for row, number in enumerate(chart.after.bin.tolist()):
        text = f"{words[number]}: {_signed(chart, chart.after, row)}"
        if chart.before is not None and number in chart.before.bin:
            old_row = int(np.flatnonzero(chart.before.bin == number)[0])
            before, after = _signed(chart, chart.before, old_row), _signed(chart, chart.after, row)
            text = f"{words[number]}: before {before}, after {after}"
        text += f", {int(chart.after.count[row]):,} beams"
        plot.target(
            ends[number], text, channel=chart.channel.name, covariate=chart.bins.name, bin=str(number),
            after=f"{chart.after.mean[row]:.6g}",
        )  # fmt: skip


def _signed(chart: ResidualChart, side: Binned, row: int) -> str:
    sign = "+" if side.mean[row] >= 0 else "−"
    return f"{sign}{chart.channel.text(abs(side.mean[row]))}"


def _brief(word: str, many: int) -> str:
    most = max(54 // max(many, 1), 4)
    return word if len(word) <= most else f"{word[: most - 1]}…"

"""Charts of residuals against what they may depend on, those that they depend on most first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.report.binned import Binned, binned, in_quantiles
from cosim.discrepancy.report.gathered import Rows
from cosim.stats.plot import Axis, Plot

COVARIATES = {
    "range": "predicted range (m)",
    "incidence": "angle of incidence (°)",
    "ring": "ring, 0 on top",
    "azimuth": "azimuth (°), left is positive",
    "intensity": "predicted intensity",
    "firing_time": "firing time from the pose time (ms)",
    "material": "material",
    "frame_time": "time of the frame (s)",
}
WORDS = {name: name.replace("_", " ") for name in COVARIATES}
_BINS = 20
_MOST_MATERIALS = 5
_ALIKE, _COMMON = 0.02, 0.02


@dataclass(frozen=True)
class ChannelOf:
    """How a channel's residuals are drawn: a factor to the shown unit, the axis' words, and a word on signs."""

    title: str
    column: str
    factor: float
    unit: str
    label: str
    signs: str


CHANNELS = (
    ChannelOf(
        "Range",
        "range_m",
        100.0,
        "cm",
        "measured − model (cm)",
        "Above zero: the sensor measures farther than the model.",
    ),
    ChannelOf(
        "Intensity", "intensity", 1.0, "", "measured − model", "Above zero: the sensor returns brighter than the model."
    ),
    ChannelOf(
        "Returns",
        "drop",
        100.0,
        "%",
        "returned − expected (%)",
        "Below zero: the sensor loses returns that the model has.",
    ),
)


@dataclass(frozen=True, eq=False)
class ResidualChart:
    """One chart and how much the residual varies along its covariate, in the shown unit; see `Binned`."""

    covariate: str
    strength: float
    apparent: float
    svg: str


def residual_charts(rows: Rows, channel: ChannelOf) -> list[ResidualChart]:
    """A chart for every covariate with more than one value; empty where the channel is absent."""
    residual = channel.factor * getattr(rows, channel.column)
    if not np.isfinite(residual).any():
        return []
    found = {name: _one(rows, name, residual) for name in COVARIATES}
    found = {name: one for name, one in found.items() if len(one.mean) > 1}
    top = _top(list(found.values()), channel)
    charts = [
        ResidualChart(name, one.strength, one.apparent, _svg(name, one, channel, top, rows.materials))
        for name, one in found.items()
    ]
    strongest = max((chart.strength for chart in charts), default=0.0)
    # A head that turns evenly makes azimuth and time of firing one thing; of equals the first stands ahead.
    near = _ALIKE * strongest or 1.0
    return sorted(charts, key=lambda chart: (-round(chart.strength / near), -round(chart.apparent / near)))


def _one(rows: Rows, name: str, residual: np.ndarray) -> Binned:
    values = rows.covariates[name]
    usable = np.isfinite(values) & np.isfinite(residual)
    kept = np.where(usable, residual, np.nan)
    if name == "ring":
        bin_of = values.astype(int)
    elif name == "material":
        common = np.argsort(-np.bincount(values[usable].astype(int)), kind="stable")[:_MOST_MATERIALS]
        bin_of = values.astype(int)
        kept = np.where(np.isin(bin_of, common), kept, np.nan)
    else:
        bin_of = np.zeros(len(values), int)
        bin_of[usable] = in_quantiles(values[usable], _BINS)
    return binned(values, bin_of, kept, rows.frame)


def _top(charts: Sequence[Binned], channel: ChannelOf) -> float:
    """One scale for all charts of a channel, so that they can be compared."""
    reach = []
    for one in charts:
        common = one.count >= _COMMON * one.count.sum()
        mean = np.abs(one.mean[common]).max(initial=0.0)
        half = np.quantile(np.nan_to_num(one.half), 0.9)
        reach.append(float(mean + min(half, mean)))
    return 1.1 * max([*reach, {"cm": 0.5, "%": 0.5}.get(channel.unit, 0.005)])


def _svg(name: str, one: Binned, channel: ChannelOf, top: float, materials: Sequence[str]) -> str:
    words: list[str] = []
    if name == "material":
        order = np.argsort(-one.count, kind="stable")
        words = [materials[int(number)] for number in one.place[order]]
        one = Binned(
            np.arange(len(order), dtype=float),
            one.mean[order],
            one.half[order],
            one.count[order],
            one.strength,
            one.apparent,
        )
        x = Axis(-0.5, len(order) - 0.5, COVARIATES[name], names=words)
    else:
        pad = 0.02 * max(float(np.ptp(one.place)), 1e-6)
        x = Axis(float(one.place.min()) - pad, float(one.place.max()) + pad, COVARIATES[name])
    plot = Plot(x, Axis(-top, top, channel.label), f"{channel.title} residual against {WORDS[name]}", 460, 280)
    plot.line(np.array([x.low, x.high]), np.zeros(2), "zero")
    half = np.nan_to_num(one.half)
    if words:
        for place, mean, side in zip(one.place, one.mean, half, strict=True):
            plot.line(np.array([place, place]), np.array([mean - side, mean + side]), "a")
        plot.line(one.place, np.where(np.isfinite(one.mean), one.mean, np.nan), "none", dots=True)
    else:
        plot.band(one.place, one.mean - half, one.mean + half, "a")
        plot.line(one.place, one.mean, "a", dots=len(one.mean) <= 2 * _BINS)
    return plot.svg()

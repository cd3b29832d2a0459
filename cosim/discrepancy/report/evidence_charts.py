"""Charts of the evidence: coefficients of one Gauss–Newton step by bin, of one covariate or of two."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.evidence_matrix import EvidenceCell, EvidenceCurve, EvidenceGrid
from cosim.discrepancy.quantities import shown
from cosim.report.plot import Axis, Plot

_STANDARD_ERRORS = 2.0
_MOST_LOG = 3.0
_WIDEST = 4.0  # times the median standard error
MOST_NAMES = 8
_BRIGHTEST_Z = 6.0
_NEUTRAL, _LESS, _MORE = (34, 41, 54), (86, 170, 255), (255, 150, 60)


def _linear(factor: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda values: factor * values


def _percent_of_log(values: np.ndarray) -> np.ndarray:
    return 100 * np.expm1(np.clip(values, -_MOST_LOG, _MOST_LOG))


@dataclass(frozen=True)
class ChannelAxis:
    """The axis of a channel in charts: label with unit, and the conversion of coefficients into that unit."""

    label: str
    convert: Callable[[np.ndarray], np.ndarray]


_ANGLE = _linear(float(np.degrees(1.0)))
AXES = {
    "range": ChannelAxis("measured − predicted range (cm)", _linear(100.0)),
    "azimuth_error": ChannelAxis("azimuth error (°)", _ANGLE),
    "elevation_error": ChannelAxis("elevation error (°)", _ANGLE),
    "intensity": ChannelAxis("change of intensity (%)", _percent_of_log),
    "intensity_offset": ChannelAxis("offset of intensity", _linear(1.0)),
    "drop": ChannelAxis("change of the probability of a return (%)", _linear(100.0)),
    "spurious": ChannelAxis("spurious returns (‰ of beams)", _linear(1000.0)),
    "early": ChannelAxis("early returns (‰ of beams)", _linear(1000.0)),
    "late": ChannelAxis("late returns (‰ of beams)", _linear(1000.0)),
    "range_variance": ChannelAxis("change of range noise (%)", _percent_of_log),
    "intensity_variance": ChannelAxis("change of intensity noise (%)", _percent_of_log),
}


def has_chart(cell: EvidenceCell) -> bool:
    """Whether coefficients by bin can be drawn."""
    return cell.channel in AXES and (cell.before is not None or cell.after is not None)


def curve_chart(cell: EvidenceCell, title: str) -> str:
    """SVG of the coefficients by one covariate with two standard errors, before and after."""
    sides = [
        (style, curve) for style, curve in (("b", cell.before), ("a", cell.after)) if isinstance(curve, EvidenceCurve)
    ]
    categories = categories_of([curve for _, curve in sides])
    if len(categories) > MOST_NAMES:
        categories = _most_significant([curve for _, curve in sides])
        sides = [(style, _selected(curve, categories)) for style, curve in sides]
    covariate, axis = shown(cell.covariates[-1]), AXES[cell.channel]
    label = _label(cell.covariates[-1])
    if categories:
        x_axis = Axis(-0.5, len(categories) - 0.5, label, names=_ticks(categories))
    else:
        places = covariate.factor * np.concatenate([_bin_positions(curve, categories) for _, curve in sides])
        pad = 0.02 * max(float(np.ptp(places)), 1e-6)
        x_axis = Axis(float(places.min()) - pad, float(places.max()) + pad, label)
    low, high = _limits(axis, [curve for _, curve in sides])
    plot = Plot(x_axis, Axis(low, high, axis.label), title, 760, 330)
    plot.line(np.array([x_axis.low, x_axis.high]), np.zeros(2), "zero")
    for number, (style, curve) in enumerate(sides):
        factor = 1.0 if categories else covariate.factor
        x, half = factor * _bin_positions(curve, categories), _STANDARD_ERRORS * curve.sigma
        y, bottom, above = (axis.convert(values) for values in (curve.y, curve.y - half, curve.y + half))
        if categories:
            x = x + (0.16 * number - 0.08) * (len(sides) > 1)
            for position, *ends in zip(x, bottom, above, strict=True):
                plot.line(np.full(2, position), np.array(ends), style)
            for position, value in zip(x, y, strict=True):
                plot.line(np.array([position]), np.array([value]), style, dots=True)
        else:
            order = np.argsort(x)
            plot.band(x[order], bottom[order], above[order], style)
            plot.line(x[order], y[order], style, dots=True)
    return plot.svg()


def categories_of(curves: Sequence[EvidenceCurve]) -> list[str]:
    """Names of the categories of all curves; empty for numbers, and for categories that are numbers."""
    names = [name for curve in curves if isinstance(curve.x, tuple) for name in curve.x]
    return [] if all(name.isdigit() for name in names) else list(dict.fromkeys(names))


def _bin_positions(curve: EvidenceCurve, categories: Sequence[str]) -> np.ndarray:
    if categories and isinstance(curve.x, tuple):
        return np.array([float(categories.index(name)) for name in curve.x])
    return np.array([float(value) for value in curve.x])


def _most_significant(curves: Sequence[EvidenceCurve]) -> list[str]:
    """The categories of the largest standardised coefficients, in their order."""
    z: dict[str, float] = {}
    for curve in curves:
        for name, y, sigma in zip(curve.x, curve.y, curve.sigma, strict=True):
            z[str(name)] = max(z.get(str(name), 0.0), abs(float(y)) / max(float(sigma), 1e-300))
    best = sorted(z, key=lambda name: -z[name])[:MOST_NAMES]
    return [name for name in z if name in best]


def _selected(curve: EvidenceCurve, categories: Sequence[str]) -> EvidenceCurve:
    """Select categories of a curve."""
    rows = [row for row, name in enumerate(curve.x) if name in categories]
    return replace(curve, x=tuple(str(curve.x[row]) for row in rows), y=curve.y[rows], sigma=curve.sigma[rows])


def _ticks(categories: Sequence[str]) -> list[str]:
    most = max(110 // len(categories), 3)
    words = [name.replace("_", " ") for name in categories]
    return [word if len(word) <= most else f"{word[: most - 1]}…" for word in words]


def sets_scale(y: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """(b,) bool bins that set the scale of a chart: those without a very large error, and significant ones."""
    return (sigma <= _WIDEST * float(np.median(sigma))) | (np.abs(y) > _STANDARD_ERRORS * sigma)


def _limits(axis: ChannelAxis, curves: Sequence[EvidenceCurve]) -> tuple[float, float]:
    """Limits of the vertical axis: all values with two standard errors, see `sets_scale`."""
    ends = [0.0]
    for curve in curves:
        usual = sets_scale(curve.y, curve.sigma)
        half = _STANDARD_ERRORS * curve.sigma
        ends += [*axis.convert(curve.y - half)[usual], *axis.convert(curve.y + half)[usual]]
    low, high = min(ends), max(ends)
    pad = 0.08 * (high - low) or 1e-6
    return low - pad, high + pad


def grid_chart(channel: str, covariates: tuple[str, ...], grid: EvidenceGrid, title: str) -> str:
    """SVG of the changes by two covariates: colour by change over standard error, values as tooltips."""
    axis, rows, columns = AXES[channel], *covariates
    x, y = _bins_axis(columns, grid.across), _bins_axis(rows, grid.x)
    plot = Plot(x, y, title, 760, 330)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = grid.y / grid.sigma
    for row, column in np.argwhere(np.isfinite(z)):
        value, half = grid.y[row, column], _STANDARD_ERRORS * grid.sigma[row, column]
        low, middle, high = (float(axis.convert(np.array(part))) for part in (value - half, value, value + half))
        where = f"{_bin_words(rows, grid.x, row)}, {_bin_words(columns, grid.across, column)}"
        words = f"{where}: {axis.label} {middle:.3g} [{low:.3g}, {high:.3g}]"
        plot.tile((column - 0.5, column + 0.5), (row - 0.5, row + 0.5), _z_colour(float(z[row, column])), words)
    return plot.svg()


def _bins_axis(name: str, bins: Sequence[str] | np.ndarray) -> Axis:
    """An axis of equally wide bins, some of them with their centres as ticks."""
    every = max(int(np.ceil(len(bins) / 8)), 1)
    names = [_bin_value(name, bins, row) if row % every == 0 else "" for row in range(len(bins))]
    return Axis(-0.5, len(bins) - 0.5, _label(name), names=names)


def _bin_value(name: str, bins: Sequence[str] | np.ndarray, row: int) -> str:
    if isinstance(bins, tuple):
        return str(bins[row]).replace("_", " ")[:14]
    return f"{shown(name).factor * float(bins[row]):.3g}"


def _bin_words(name: str, bins: Sequence[str] | np.ndarray, row: int) -> str:
    covariate = shown(name)
    return f"{covariate.words} {_bin_value(name, bins, row)} {covariate.unit}".rstrip()


def _label(name: str) -> str:
    covariate = shown(name)
    return f"{covariate.words} ({covariate.unit})" if covariate.unit else covariate.words


def _z_colour(z: float) -> str:
    share, end = min(abs(z) / _BRIGHTEST_Z, 1.0), _MORE if z > 0 else _LESS
    return "rgb({},{},{})".format(*(round(a + share * (b - a)) for a, b in zip(_NEUTRAL, end, strict=True)))

"""Simple figures of a patch: what its ranges, its returns and its intensities look like."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CHANNELS = ("geometry", "returns", "intensity")
_SMOOTH_M = 0.3  # a step along a row that does not leave the surface
_SATURATED = 0.98
_DARK = 0.1


@dataclass(frozen=True)
class Figure:
    """A figure of a patch: its key, its words, its channel."""

    key: str
    title: str
    channel: str


FIGURES = (
    Figure("range_p10", "range, 10 % quantile (m)", "geometry"),
    Figure("range_p50", "range, median (m)", "geometry"),
    Figure("range_p90", "range, 90 % quantile (m)", "geometry"),
    Figure("range_spread", "spread of the logarithm of range", "geometry"),
    Figure("row_step_p50", "step of range along a row, median (m)", "geometry"),
    Figure("row_step_p90", "step of range along a row, 90 % quantile (m)", "geometry"),
    Figure("row_steps_small", "steps along a row of 0.1–1 m, share", "geometry"),
    Figure("row_steps_large", "steps along a row above 1 m, share", "geometry"),
    Figure("roughness", "second difference along a row, median (m)", "geometry"),
    Figure("column_step_p50", "step of range between rows, median (m)", "geometry"),
    Figure("column_step_p90", "step of range between rows, 90 % quantile (m)", "geometry"),
    Figure("returned", "cells with a return, share", "returns"),
    Figure("single_gaps", "single missing cells between returns, share", "returns"),
    Figure("gap_length", "missing cells in a row, mean length", "returns"),
    Figure("run_length", "cells with returns in a row, mean length", "returns"),
    Figure("empty_rows", "rows without return, share", "returns"),
    Figure("returned_spread", "spread of the share of returns between rows", "returns"),
    Figure("intensity_mean", "intensity, mean", "intensity"),
    Figure("intensity_spread", "intensity, standard deviation of non-zero values", "intensity"),
    Figure("zeros", "intensity 0, share", "intensity"),
    Figure("dark", f"intensity above 0 and to {_DARK}, share", "intensity"),
    Figure("bright", f"intensity above {_SATURATED}, share", "intensity"),
    Figure("intensity_row_correlation", "correlation of intensity with the next in the row", "intensity"),
    Figure("intensity_column_correlation", "correlation of intensity with the next row", "intensity"),
    Figure("zero_runs", "chance of 0 after 0 in a row", "intensity"),
)


def measure_figures(range_m: np.ndarray, intensity: np.ndarray) -> np.ndarray:
    """The figures of patches, (n, 25) float32; NaN where a figure does not exist.

    Args:
        range_m: (n, rows, columns) ranges [m], NaN where there is no return.
        intensity: (n, rows, columns), NaN where there is no return.
    """
    with np.errstate(all="ignore"):
        columns = [*_geometry(range_m), *_returns(np.isfinite(range_m)), *_intensity(intensity)]
    return np.stack(columns, 1).astype(np.float32)


def _geometry(range_m: np.ndarray) -> list[np.ndarray]:
    flat = range_m.reshape(len(range_m), -1)
    along, across = np.abs(np.diff(range_m, axis=2)), np.abs(np.diff(range_m, axis=1))
    smooth = (along[:, :, 1:] < _SMOOTH_M) & (along[:, :, :-1] < _SMOOTH_M)
    bend = np.where(smooth, np.abs(np.diff(range_m, 2, axis=2)), np.nan)
    steps, down, bend = (values.reshape(len(range_m), -1) for values in (along, across, bend))
    return [
        *_quantiles(flat, (10, 50, 90)),
        _spread(np.log(flat)),
        *_quantiles(steps, (50, 90)),
        _share((steps > 0.1) & (steps <= 1), np.isfinite(steps)),
        _share(steps > 1, np.isfinite(steps)),
        *_quantiles(bend, (50,)),
        *_quantiles(down, (50, 90)),
    ]


def _returns(there: np.ndarray) -> list[np.ndarray]:
    cells = there.shape[1] * there.shape[2]
    single = there[:, :, :-2] & ~there[:, :, 1:-1] & there[:, :, 2:]
    by_row = there.mean(2)
    starts = _starts(there)
    gaps = _starts(~there)
    return [
        there.sum((1, 2)) / cells,
        single.sum((1, 2)) / cells,
        (~there).sum((1, 2)) / gaps,
        there.sum((1, 2)) / starts,
        (~there.any(2)).mean(1),
        by_row.std(1),
    ]


def _intensity(intensity: np.ndarray) -> list[np.ndarray]:
    flat = intensity.reshape(len(intensity), -1)
    there = np.isfinite(flat)
    zero = np.where(np.isfinite(intensity), intensity < 0.005, False)
    pair = np.isfinite(intensity[:, :, 1:]) & zero[:, :, :-1]
    return [
        np.nansum(flat, 1) / there.sum(1),
        _spread(np.where(flat >= 0.005, flat, np.nan)),
        _share(flat < 0.005, there),
        _share((flat >= 0.005) & (flat <= _DARK), there),
        _share(flat > _SATURATED, there),
        _correlation(intensity[:, :, :-1], intensity[:, :, 1:]),
        _correlation(intensity[:, :-1], intensity[:, 1:]),
        _share((pair & zero[:, :, 1:]).reshape(len(flat), -1), pair.reshape(len(flat), -1)),
    ]


def _starts(mask: np.ndarray) -> np.ndarray:
    """Number of runs of True along rows, (n,)."""
    return mask[:, :, 0].sum(1) + (mask[:, :, 1:] & ~mask[:, :, :-1]).sum((1, 2))


def _share(part: np.ndarray, whole: np.ndarray) -> np.ndarray:
    return part.sum(1) / whole.sum(1)


def _spread(values: np.ndarray) -> np.ndarray:
    there = np.isfinite(values)
    count, filled = there.sum(1), np.where(there, values, 0)
    mean = filled.sum(1) / count
    return np.sqrt(np.maximum((filled**2).sum(1) / count - mean**2, 0))


def _quantiles(values: np.ndarray, percents: tuple[int, ...]) -> list[np.ndarray]:
    """Quantiles of each row's finite values: its sorted values at the nearest rank."""
    ordered = np.sort(values, axis=1)  # NaN last
    count = np.isfinite(values).sum(1)
    rows = np.arange(len(values))
    found = []
    for percent in percents:
        position = np.clip(np.rint((count - 1) * percent / 100).astype(int), 0, None)
        found.append(np.where(count > 0, ordered[rows, position], np.nan))
    return found


def _correlation(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    left, right = left.reshape(len(left), -1), right.reshape(len(right), -1)
    there = np.isfinite(left) & np.isfinite(right)
    count = there.sum(1)
    x, y = np.where(there, left, 0), np.where(there, right, 0)
    x, y = x - (x.sum(1) / count)[:, None], y - (y.sum(1) / count)[:, None]
    x, y = np.where(there, x, 0), np.where(there, y, 0)
    return (x * y).sum(1) / np.sqrt((x**2).sum(1) * (y**2).sum(1))

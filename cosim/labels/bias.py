"""Test whether labelled boxes are systematically smaller than the vehicles, and fit the bias."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy import stats

from cosim.drives.kitti import Drive
from cosim.labels.bodies import LabelRows, gather
from sensors.effects.labels.box_shrink import BoxShrink
from sensors.sensor_model import SensorModel

AXES = ("length", "width", "height")
_MIN_TRACKS = 8
_FLIPS = 9999
_RESOLUTION_M = 0.003  # KITTI's labels are rounded to centimetres
_VALIDATION_EVERY = 3


@dataclass(frozen=True)
class Certainty:
    """Significance level, interval coverage and power of the test.

    Attributes:
        level: family-wise error rate over all edges.
        coverage: coverage of confidence intervals.
        power: normal quantile of the power of `smallest_m`; 0.84 for 80 %.
    """

    level: float = 0.05
    coverage: float = 0.95
    power: float = 0.84


@dataclass(frozen=True, eq=False)
class LabelFinding:
    """Result of the test for label bias.

    Attributes:
        verdict: `none`, `missing` (the effect `box_shrink` is missing), or `untold` (the test is not possible).
        objects, tracks: number of labels and of vehicles that were compared with the twin.
        p_value: family-wise p-value, under the hypothesis that labels are unbiased.
        a_m, b: (3,) fitted parameters for length, width and height; totals, including a known effect.
        lift_m: height of the lower edge of the labels above that of the vehicles [m].
        ci95: confidence intervals of `a_m` and `b`, lists of pairs.
        smallest_m: (3,) smallest constant bias that is detected with 80 % power [m].
        error_before, error_after: mean absolute error of the edges on validation vehicles before and after the fit [m].
        why: reason why the test is not possible, or empty.
    """

    verdict: Literal["none", "missing", "untold"]
    objects: int
    tracks: int
    p_value: float = 1.0
    a_m: tuple[float, ...] = ()
    b: tuple[float, ...] = ()
    lift_m: float = 0.0
    ci95: dict[str, list[list[float]]] | None = None
    smallest_m: tuple[float, ...] = ()
    error_before: float = float("nan")
    error_after: float = float("nan")
    why: str = ""

    @property
    def effect(self) -> BoxShrink | None:
        """The label effect, if one is missing."""
        if self.verdict != "missing":
            return None
        return BoxShrink(a_m=self.a_m, b=self.b, lift_m=self.lift_m)

    def to_json(self) -> dict[str, Any]:
        """The part `labels` of the JSON output of `cosim diagnose`."""
        missing = self.verdict == "missing"
        return {
            "verdict": self.verdict,
            "effect": "box_shrink" if missing else None,
            "params": {"a_m": list(self.a_m), "b": list(self.b), "lift_m": self.lift_m} if missing else {},
            "ci95": self.ci95 if missing else {},
            "p_value": self.p_value,
            "objects": self.objects,
            "tracks": self.tracks,
            "error_before_m": self.error_before,
            "error_after_m": self.error_after,
            "smallest_detectable": {"a_m": list(self.smallest_m)} if self.smallest_m else {},
            "why": self.why or None,
        }

    def __str__(self) -> str:
        if self.verdict == "untold":
            return f"labels: {self.why}"
        if self.verdict == "none":
            smallest = " × ".join(f"{100 * max(value, _RESOLUTION_M):.1f}" for value in self.smallest_m)
            return f"labels: unbiased; the smallest detectable bias is {smallest} cm (length × width × height)"
        equation = ", ".join(f"{axis} {a:.3f} m + {b:.2f}·d" for axis, a, b in zip(AXES, self.a_m, self.b, strict=True))
        return (
            f"labels: box_shrink ({equation}; lifted by {100 * self.lift_m:.0f} cm), p = {self.p_value:.4f}; "
            f"mean error of the edges {100 * self.error_before:.1f} → {100 * self.error_after:.1f} cm"
        )


def diagnose_labels(
    drive: Drive, sensor: SensorModel | None = None, seed: int = 0, certainty: Certainty | None = None
) -> LabelFinding:
    """Test whether labelled boxes are smaller than the vehicles of the twin.

    The bias of an edge is modelled as a + b·d, d being the difference between the edge of the vehicle and the extent of
    its points. All labels of a vehicle are one independent observation: p-values are from sign flips per vehicle, and
    confidence intervals are clustered by vehicle (Liang and Zeger, Biometrika 1986).

    Args:
        drive: drive with labels, points and a twin that was not made from these labels.
        sensor: sensor model; its `box_shrink`, if any, is taken as known, and the fitted parameters are totals.
        seed: random seed of the sign flips.
        certainty: significance level, coverage and power; by default 5 %, 95 % and 80 %.
    """
    rows = gather(drive)
    if not len(rows):
        return LabelFinding("untold", 0, 0, why="no labelled vehicle has a body in the twin and points on it")
    if np.abs(rows.loss_m).max() < _RESOLUTION_M and np.abs(rows.raised_m).max() < _RESOLUTION_M:
        return LabelFinding("untold", len(rows), rows.tracks, why="the twin's boxes are the labels themselves")
    if rows.tracks < _MIN_TRACKS:
        why = f"{rows.tracks} labelled vehicles are too few; {_MIN_TRACKS} are needed"
        return LabelFinding("untold", len(rows), rows.tracks, why=why)
    return _test_bias(rows, _box_shrink_of(sensor), certainty or Certainty(), np.random.default_rng([seed, 5]))


def _box_shrink_of(sensor: SensorModel | None) -> BoxShrink | None:
    effects = sensor.effects if sensor is not None else ()
    return next((effect for effect in effects if isinstance(effect, BoxShrink)), None)


def _test_bias(
    rows: LabelRows, known: BoxShrink | None, certainty: Certainty, rng: np.random.Generator
) -> LabelFinding:
    before = np.zeros_like(rows.loss_m) if known is None else np.array(known.a_m) + np.array(known.b) * rows.gap_m
    p_value, critical = _flip_signs(rows, rows.loss_m - before, certainty.level, rng)
    every_row = np.ones(len(rows), bool)
    validation = rows.track % _VALIDATION_EVERY == _VALIDATION_EVERY - 1
    training_fit = _fit(rows, ~validation if (~validation).sum() >= _MIN_TRACKS else every_row)
    after = training_fit.a + training_fit.b * rows.gap_m
    scored = validation if validation.any() else every_row
    fit = _fit(rows, every_row)
    return LabelFinding(
        verdict="missing" if p_value <= certainty.level else "none",
        objects=len(rows),
        tracks=rows.tracks,
        p_value=p_value,
        a_m=tuple(np.round(fit.a, 5).tolist()),
        b=tuple(np.round(fit.b, 5).tolist()),
        lift_m=fit.lift,
        ci95={"a_m": fit.intervals(0, certainty.coverage), "b": fit.intervals(1, certainty.coverage)},
        smallest_m=tuple(((critical + certainty.power) * _standard_error(rows)).tolist()),
        error_before=float(np.abs(rows.loss_m - before)[scored].mean()),
        error_after=float(np.abs(rows.loss_m - after)[scored].mean()),
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """Parameters a and b (3,), the lift, and standard errors (2, 3) with their degrees of freedom."""

    a: np.ndarray
    b: np.ndarray
    lift: float
    errors: np.ndarray
    freedom: int

    def intervals(self, row: int, coverage: float) -> list[list[float]]:
        half = float(stats.t.ppf((1 + coverage) / 2, max(self.freedom, 1))) * self.errors[row]
        middle, top = (self.a, 2.0) if row == 0 else (self.b, 1.0)
        pairs = zip((middle - half).tolist(), (middle + half).tolist(), strict=True)
        return [[max(low, 0.0), min(high, top)] for low, high in pairs]


def _fit(rows: LabelRows, mask: np.ndarray) -> _Fit:
    """Fit each edge by least squares with non-negative a and b."""
    loss, gap, track = rows.loss_m[mask], rows.gap_m[mask], rows.track[mask]
    a, b, errors = np.zeros(3), np.zeros(3), np.zeros((2, 3))
    for axis in range(3):
        design = np.column_stack([np.ones(len(loss)), gap[:, axis]])
        normal = np.linalg.inv(design.T @ design + 1e-9 * np.eye(2))
        best = normal @ design.T @ loss[:, axis]
        if best[0] < 0:
            best = np.array([0.0, (gap[:, axis] @ loss[:, axis]) / max(gap[:, axis] @ gap[:, axis], 1e-9)])
        if best[1] < 0:
            best = np.array([loss[:, axis].mean(), 0.0])
        scores = _sum_by_track(design * (loss[:, axis] - design @ best)[:, None], track)
        errors[:, axis] = np.sqrt(np.diag(normal @ scores.T @ scores @ normal))
        a[axis], b[axis] = np.clip(best, 0, (2, 1))
    bias = a[2] + b[2] * gap[:, 2]
    lift = float(np.clip(np.median(rows.raised_m[mask] - bias * rows.below[mask]), 0, 0.5))
    return _Fit(a, b, round(lift, 4), errors, len(np.unique(track)) - 2)


def _flip_signs(rows: LabelRows, loss: np.ndarray, level: float, rng: np.random.Generator) -> tuple[float, float]:
    """Family-wise p-value and critical value over constants and slopes of all edges, by sign flips per vehicle."""
    gap = rows.gap_m - rows.gap_m.mean(0)
    scores = _sum_by_track(np.concatenate([loss, loss * gap], 1), rows.track)
    size = np.sqrt(np.maximum((scores**2).sum(0), 1e-18))
    observed = np.abs(scores.sum(0)) / size
    signs = rng.choice((-1.0, 1.0), (_FLIPS, len(scores)))
    largest = (np.abs(signs @ scores) / size).max(1)
    return float((1 + (largest >= observed.max()).sum()) / (1 + _FLIPS)), float(np.quantile(largest, 1 - level))


def _standard_error(rows: LabelRows) -> np.ndarray:
    """Standard error of the mean loss of each edge (3,), clustered by vehicle [m]."""
    scores = _sum_by_track(rows.loss_m - rows.loss_m.mean(0), rows.track)
    return np.sqrt((scores**2).sum(0)) / len(rows)


def _sum_by_track(values: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Sum the rows of each vehicle."""
    names, code = np.unique(track, return_inverse=True)
    sums = np.zeros((len(names), values.shape[1]))
    np.add.at(sums, code, values)
    return sums

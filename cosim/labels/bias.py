"""Whether labelled boxes are smaller than bodies are, and by what law."""

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
_FEWEST_TRACKS = 8
_FLIPS = 9999
_TINY_M = 0.003  # KITTI's labels are written in centimetres
_JUDGE_EVERY = 3


@dataclass(frozen=True)
class Certainty:
    """How sure a finding must be.

    Attributes:
        level: error rate of all edges together.
        coverage: of intervals.
        power: deviate that the power of `smallest_m` adds to a critical value, 0.84 for 80 %.
    """

    level: float = 0.05
    coverage: float = 0.95
    power: float = 0.84


@dataclass(frozen=True, eq=False)
class LabelFinding:
    """What the labels of a drive say.

    Attributes:
        verdict: none, missing (`box_shrink`), or untold.
        objects, tracks: how many labels and vehicles were compared with their bodies.
        p_value: the chance that any edge would look this biased if labels were right on average.
        a_m, b: (3,) fitted totals for length, width and height.
        lift_m: how much labels are lifted off the road.
        ci95: of `a_m` and `b`, lists of pairs.
        smallest_m: (3,) the smallest constant loss that would have been seen with 80 % power.
        error_before, error_after: mean absolute error of edges on vehicles that took no part in the fit [m].
        why: why nothing can be told, or empty.
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
        """Plain values: the part `labels` of what `cosim diagnose --json` writes."""
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
            seen = " × ".join(f"{100 * max(value, _TINY_M):.1f}" for value in self.smallest_m)
            return f"labels: unbiased; a loss of {seen} cm (length × width × height) would have shown"
        law = ", ".join(f"{axis} {a:.3f} m + {b:.2f}·d" for axis, a, b in zip(AXES, self.a_m, self.b, strict=True))
        return (
            f"labels: box_shrink ({law}; lifted {100 * self.lift_m:.0f} cm), p = {self.p_value:.4f}; "
            f"error of edges {100 * self.error_before:.1f} → {100 * self.error_after:.1f} cm"
        )


def diagnose_labels(
    drive: Drive, sensor: SensorModel | None = None, seed: int = 0, certainty: Certainty | None = None
) -> LabelFinding:
    """Compare labelled boxes with the bodies of the twin: does each edge lose a + b·d, d the gap to the points?

    Every vehicle is one fact, however often it was labelled: signs are flipped vehicle by vehicle, and intervals are
    clustered by vehicle (Liang and Zeger, Biometrika 1986).

    Args:
        drive: with labels, points and a twin that was not made from these labels.
        sensor: whose own `box_shrink`, if it has one, is taken for known; parameters found are totals.
        seed: of the signs.
        certainty: how sure a finding must be; by default as sure as the conventions of the field have it.
    """
    rows = gather(drive)
    if not len(rows):
        return LabelFinding("untold", 0, 0, why="no labelled vehicle has a body in the twin and points on it")
    if np.abs(rows.loss_m).max() < _TINY_M and np.abs(rows.raised_m).max() < _TINY_M:
        return LabelFinding("untold", len(rows), rows.tracks, why="the twin's boxes are the labels themselves")
    if rows.tracks < _FEWEST_TRACKS:
        why = f"{rows.tracks} labelled vehicles are too few; {_FEWEST_TRACKS} are needed"
        return LabelFinding("untold", len(rows), rows.tracks, why=why)
    return _judged(rows, _known(sensor), certainty or Certainty(), np.random.default_rng([seed, 5]))


def _known(sensor: SensorModel | None) -> BoxShrink | None:
    effects = sensor.effects if sensor is not None else ()
    return next((one for one in effects if isinstance(one, BoxShrink)), None)


def _judged(rows: LabelRows, known: BoxShrink | None, by: Certainty, rng: np.random.Generator) -> LabelFinding:
    before = np.zeros_like(rows.loss_m) if known is None else np.array(known.a_m) + np.array(known.b) * rows.gap_m
    p_value, critical = _gate(rows, rows.loss_m - before, by.level, rng)
    judge = rows.track % _JUDGE_EVERY == _JUDGE_EVERY - 1
    fitted = _fit(rows, ~judge) if (~judge).sum() >= _FEWEST_TRACKS else _fit(rows, np.ones(len(rows), bool))
    after = fitted.a + fitted.b * rows.gap_m
    told = judge if judge.any() else np.ones(len(rows), bool)
    found = _fit(rows, np.ones(len(rows), bool))
    return LabelFinding(
        verdict="missing" if p_value <= by.level else "none",
        objects=len(rows),
        tracks=rows.tracks,
        p_value=p_value,
        a_m=tuple(np.round(found.a, 5).tolist()),
        b=tuple(np.round(found.b, 5).tolist()),
        lift_m=found.lift,
        ci95={"a_m": found.ends(0, by.coverage), "b": found.ends(1, by.coverage)},
        smallest_m=tuple(((critical + by.power) * _error_of_mean(rows)).tolist()),
        error_before=float(np.abs(rows.loss_m - before)[told].mean()),
        error_after=float(np.abs(rows.loss_m - after)[told].mean()),
    )


@dataclass(frozen=True, eq=False)
class _Law:
    """a and b (3,), the lift, and standard errors (2, 3) with their degrees of freedom."""

    a: np.ndarray
    b: np.ndarray
    lift: float
    errors: np.ndarray
    freedom: int

    def ends(self, row: int, coverage: float) -> list[list[float]]:
        half = float(stats.t.ppf((1 + coverage) / 2, max(self.freedom, 1))) * self.errors[row]
        middle, top = (self.a, 2.0) if row == 0 else (self.b, 1.0)
        pairs = zip((middle - half).tolist(), (middle + half).tolist(), strict=True)
        return [[max(low, 0.0), min(high, top)] for low, high in pairs]


def _fit(rows: LabelRows, chosen: np.ndarray) -> _Law:
    """Least squares edge by edge; neither a nor b is negative."""
    loss, gap, track = rows.loss_m[chosen], rows.gap_m[chosen], rows.track[chosen]
    a, b, errors = np.zeros(3), np.zeros(3), np.zeros((2, 3))
    for axis in range(3):
        design = np.column_stack([np.ones(len(loss)), gap[:, axis]])
        normal = np.linalg.inv(design.T @ design + 1e-9 * np.eye(2))
        best = normal @ design.T @ loss[:, axis]
        if best[0] < 0:
            best = np.array([0.0, (gap[:, axis] @ loss[:, axis]) / max(gap[:, axis] @ gap[:, axis], 1e-9)])
        if best[1] < 0:
            best = np.array([loss[:, axis].mean(), 0.0])
        scores = _by_track(design * (loss[:, axis] - design @ best)[:, None], track)
        errors[:, axis] = np.sqrt(np.diag(normal @ scores.T @ scores @ normal))
        a[axis], b[axis] = np.clip(best, 0, (2, 1))
    lost = a[2] + b[2] * gap[:, 2]
    lift = float(np.clip(np.median(rows.raised_m[chosen] - lost * rows.below[chosen]), 0, 0.5))
    return _Law(a, b, round(lift, 4), errors, len(np.unique(track)) - 2)


def _gate(rows: LabelRows, loss: np.ndarray, level: float, rng: np.random.Generator) -> tuple[float, float]:
    """Family-wise p-value over all edges, of the constant and of the slope, by flipping signs of vehicles."""
    gap = rows.gap_m - rows.gap_m.mean(0)
    scores = _by_track(np.concatenate([loss, loss * gap], 1), rows.track)
    size = np.sqrt(np.maximum((scores**2).sum(0), 1e-18))
    seen = np.abs(scores.sum(0)) / size
    signs = rng.choice((-1.0, 1.0), (_FLIPS, len(scores)))
    largest = (np.abs(signs @ scores) / size).max(1)
    return float((1 + (largest >= seen.max()).sum()) / (1 + _FLIPS)), float(np.quantile(largest, 1 - level))


def _error_of_mean(rows: LabelRows) -> np.ndarray:
    """Standard error of the mean loss of each edge (3,), by vehicle."""
    scores = _by_track(rows.loss_m - rows.loss_m.mean(0), rows.track)
    return np.sqrt((scores**2).sum(0)) / len(rows)


def _by_track(values: np.ndarray, track: np.ndarray) -> np.ndarray:
    """Sums of rows by vehicle."""
    names, code = np.unique(track, return_inverse=True)
    sums = np.zeros((len(names), values.shape[1]))
    np.add.at(sums, code, values)
    return sums

"""Fits parameters of effects to a sample, together with the pose errors of every scan.

Gauss–Newton on the likelihood of `likelihood.py`. Pose errors are random effects whose spread is estimated along
(expectation–maximisation), so that a mount that is off is told from scans that are each off by their own error.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from cosim.discrepancy.candidates import Unknown, unknowns, with_values
from cosim.discrepancy.data.sample import Prediction, Sample
from cosim.discrepancy.inference.columns import Column, Normal, SparseMatrix
from cosim.discrepancy.inference.likelihood import Fit, judge, range_spread_m
from cosim.discrepancy.inference.pose_errors import PoseErrors
from cosim.discrepancy.inference.score import ROUNDED_M, Evidence, Quantity, change
from cosim.discrepancy.inference.search import is_searched, searched
from sensors.effects.base import Effect, RoundingEffect, ScanEffect

POSE_FLOOR = np.array([5e-4] * 3 + [np.radians(2e-3)] * 3)
_POSE_START = np.array([0.02] * 3 + [np.radians(0.05)] * 3)
_POSE_MOST = np.array([0.5] * 3 + [np.radians(3.0)] * 3)
_GAIN_M = 1e-3  # log-likelihood that a step must still bring
_STEPS = 12
_KEPT_STEPS = 3  # for which slopes of what is about right already are kept
_HALVINGS = 6
_FAR_M, _FINE_M = 3.0, 0.01
_ROUGH, _ROUGH_SHARE = 8.0, 0.985


@dataclass(frozen=True)
class Free:
    """A parameter of one of the effects that is fitted: which effect, and what can be fitted of it."""

    effect: int
    unknown: Unknown


@dataclass(frozen=True, eq=False)
class Fitted:
    """A fit.

    Attributes:
        effects: with fitted parameters.
        free: what was fitted.
        pose: (scans, 6) estimated pose errors.
        pose_sigma: (6,) their spread.
        loglik: of the sample, pose errors integrated out (Laplace).
        prediction, fit, evidence: at the end.
        columns: linearisation there, one for each of `free`.
    """

    effects: tuple[Effect, ...]
    free: tuple[Free, ...]
    pose: np.ndarray
    pose_sigma: np.ndarray
    loglik: float
    prediction: Prediction
    fit: Fit
    evidence: Evidence
    columns: tuple[Column, ...]

    def free_of(self, effect: int) -> list[Free]:
        """What was fitted of one of the effects."""
        return [free for free in self.free if free.effect == effect]


class Fitter:
    """Fits effects to a sample.

    Args:
        sample: the measurements.

    Attributes:
        rings: how many there are.
        again: fits, and the same with effects at some places fitted anew, by these.
    """

    def __init__(self, sample: Sample) -> None:
        self.sample = sample
        self.pose_errors = PoseErrors(sample.pose_derivative, sample.frame, sample.range_m, sample.leaning)
        self.again: dict[tuple[int, ...], tuple[Fitted, Fitted]] = {}
        self.rings = int(sample.ring.max(initial=0)) + 1
        self._scans = len(sample.names)

    def fit(
        self,
        effects: Sequence[Effect],
        free: Sequence[Free],
        *,
        pose: np.ndarray | None = None,
        pose_sigma: np.ndarray | None = None,
        steps: int = _STEPS,
        near: Collection[int] = (),
        roughly: bool = False,
    ) -> Fitted:
        """Fit some parameters, starting from those the effects have.

        Args:
            effects: all effects of the sensor.
            free: what may change.
            pose, pose_sigma: where to start with the scans' pose errors; else with those that were traced with.
            steps: most Gauss–Newton steps.
            near: places of effects that are about right already, where a search need not go far and slopes stay.
            roughly: search no closer than it takes to tell candidates apart.
        """
        current, free = tuple(effects), tuple(free)
        pose = self.sample.leaning if pose is None else pose
        sigma = _POSE_START if pose_sigma is None else pose_sigma
        state = self._state(current, pose)
        sought = [one.by_search or isinstance(one, ScanEffect) for one in current]
        gradual = tuple(one for one in free if not sought[one.effect])
        for blur in self._blurs(state[0], pose):
            current, pose, sigma = self._descend(current, gradual, pose, sigma, blur, steps, near)
            state = self._state(current, pose)
        current = self._searched(current, free, pose, sigma, near, roughly)
        state = self._state(current, pose)
        columns = self.columns(current, free, state[0])
        evidence = Evidence.of(self.sample, state[1])
        loglik = self._marginal(state, pose, sigma)
        return Fitted(current, free, pose, sigma, loglik, state[0], state[1], evidence, columns)

    def _searched(
        self,
        effects: tuple[Effect, ...],
        free: tuple[Free, ...],
        pose: np.ndarray,
        sigma: np.ndarray,
        near: Collection[int],
        roughly: bool,
    ) -> tuple[Effect, ...]:
        """With numbers that no slope tells of, such as hard limits, where they are likeliest."""
        prediction, fit = self._state(effects, pose)
        columns = self.columns(effects, free, prediction)
        which = [
            (one.effect, one.unknown, column)
            for one, column in zip(free, columns, strict=True)
            if effects[one.effect].by_search or is_searched(effects[one.effect], one.unknown, column)
        ]
        if not which:
            return effects
        return searched(effects, which, self.loss(pose, sigma), self.sample, fit, near, roughly=roughly)

    def loss(self, pose: np.ndarray, sigma: np.ndarray) -> Callable[[tuple[Effect, ...]], float]:
        """Negative log-likelihood of effects, pose errors as they are."""
        return lambda effects: -self._penalised(self._state(effects, pose)[1], pose, sigma)

    def losses(self, effects: tuple[Effect, ...], pose: np.ndarray) -> np.ndarray:
        """The part (n,) that every beam has in it."""
        return -self.sample.share * self._state(effects, pose)[1].loglik

    def columns(self, effects: tuple[Effect, ...], free: Sequence[Free], at: Prediction) -> tuple[Column, ...]:
        """How the prediction changes with each free parameter."""
        found = []
        for one in free:
            effect, unknown = effects[one.effect], one.unknown
            value = np.asarray(getattr(effect, unknown.name), float)
            step = unknown.step if np.all(value + unknown.step <= unknown.high) else -unknown.step
            moved = with_values(effect, {unknown.name: value + step})
            after = self.sample.predict((*effects[: one.effect], moved, *effects[one.effect + 1 :]))
            delta: dict[Quantity, np.ndarray] = {name: values / step for name, values in change(at, after).items()}
            ring = self.sample.ring if unknown.rings > 1 else None
            found.append(Column(delta, ring, unknown.rings))
        return tuple(found)

    def shift(self, pose: np.ndarray, prediction: Prediction) -> np.ndarray:
        """Change of predicted ranges (n,) [m] by pose errors (scans, 6)."""
        return self.pose_errors.shift(pose, prediction.range_m)

    def slopes(self, pose: np.ndarray, prediction: Prediction) -> SparseMatrix:
        """(n, 6·scans) its derivatives; (n, 0) where poses have no errors."""
        if self.sample.own_axes:
            return sparse.csr_matrix((len(self.sample), 0))
        return self.pose_errors.slopes(pose, prediction.range_m)

    def precision(self, sigma: np.ndarray) -> np.ndarray:
        """Inverse variances of the pose errors that there are, (6·scans,) or (0,), for a spread (6,)."""
        return np.tile(1 / sigma**2, 0 if self.sample.own_axes else self._scans)

    def _state(self, effects: tuple[Effect, ...], pose: np.ndarray, blur: float = 0.0) -> tuple[Prediction, Fit]:
        prediction = self.sample.predict(effects)
        return prediction, judge(self.sample, prediction, blur, self.shift(pose, prediction))

    def _blurs(self, prediction: Prediction, pose: np.ndarray) -> list[float]:
        """Widths of ranges to fit with one after the other, down to none."""
        wide = self.roughness(prediction, pose)
        blurs = []
        while wide > 0:
            blurs.append(wide)
            wide = wide / 4 if wide / 4 > _FINE_M else 0.0
        return [*blurs, 0.0]

    def roughness(self, prediction: Prediction, pose: np.ndarray) -> float:
        """How far off ranges are where they are far off [m]; 0 where all are within a few standard deviations."""
        mean = prediction.range_m + self.shift(pose, prediction)
        gap = np.where(self.sample.compared, np.abs(self.sample.along_m - mean), np.nan)
        near = np.isfinite(gap) & (gap < _FAR_M)
        if not near.any():
            return 0.0
        order = np.argsort(gap[near])
        below = np.cumsum(self.sample.weight[near][order])
        wide = float(gap[near][order][np.searchsorted(below, _ROUGH_SHARE * below[-1])])
        stated = float(np.median(range_spread_m(prediction)[near]))
        return wide if wide > _ROUGH * max(stated, _FINE_M) else 0.0

    def evidence(self, prediction: Prediction, pose: np.ndarray | None = None, blur: float = 0.0) -> Evidence:
        """The evidence at a prediction, for tests: with a standard deviation of `blur` [m] added to every range.

        Without pose errors poses are as they are said.
        """
        shift = self.shift(np.zeros((self._scans, 6)) if pose is None else pose, prediction)
        return Evidence.of(self.sample, judge(self.sample, prediction, blur, shift), blur, ROUNDED_M)

    def _descend(
        self,
        effects: tuple[Effect, ...],
        free: tuple[Free, ...],
        pose: np.ndarray,
        sigma: np.ndarray,
        blur: float,
        steps: int,
        near: Collection[int],
    ) -> tuple[tuple[Effect, ...], np.ndarray, np.ndarray]:
        prediction, fit = self._state(effects, pose, blur)
        value, columns = self._penalised(fit, pose, sigma), dict[Free, Column]()
        for number in range(steps):
            evidence = Evidence.of(self.sample, fit, blur).reweighted(fit)
            poses = self.slopes(pose, prediction)
            anew = [one for one in free if number % _KEPT_STEPS == 0 or one.effect not in near]
            columns |= zip(anew, self.columns(effects, anew, prediction), strict=True)
            normal = Normal.of([columns[one] for one in free], evidence, poses)
            precision = self.precision(sigma)
            right = normal.right.copy()
            right[normal.parameters :] -= precision * pose.ravel()[: len(precision)]
            prior = np.append(np.zeros(normal.parameters), precision)
            system = normal.matrix + np.diag(prior + 1e-9 * np.diag(normal.matrix) + 1e-12)
            step = np.linalg.solve(system, right)
            if not np.isfinite(step).all():
                break
            gained = -np.inf
            for halving in range(_HALVINGS):
                part = step * 0.5**halving
                trial = _moved(effects, free, part[: normal.parameters])
                tilted = pose + part[normal.parameters :].reshape(pose.shape) if len(precision) else pose
                state = self._state(trial, tilted, blur)
                reached = self._penalised(state[1], tilted, sigma)
                if reached > value:
                    gained = reached - value
                    effects, pose, (prediction, fit), value = trial, tilted, state, reached
                    break
            sigma = self._spread(normal, pose, sigma)
            value = self._penalised(fit, pose, sigma)
            if gained < max(_GAIN_M, 1e-7 * abs(value)):
                break
        return effects, pose, sigma

    def _spread(self, normal: Normal, pose: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """One step of expectation–maximisation for the spread of pose errors."""
        if self.sample.own_axes:
            return sigma
        count = normal.parameters
        block = normal.matrix[count:, count:] + np.diag(self.precision(sigma))
        uncertain = np.diag(np.linalg.inv(block)).reshape(-1, 6)
        return np.clip(np.sqrt((pose**2 + uncertain).mean(0)), POSE_FLOOR, _POSE_MOST)

    def _penalised(self, fit: Fit, pose: np.ndarray, sigma: np.ndarray) -> float:
        return float(self.sample.share @ fit.loglik) - 0.5 * float(((pose / sigma) ** 2).sum())

    def _marginal(self, state: tuple[Prediction, Fit], pose: np.ndarray, sigma: np.ndarray) -> float:
        prediction, fit = state
        normal = Normal.of((), Evidence.of(self.sample, fit), self.slopes(pose, prediction))
        scale = 1 / np.sqrt(self.precision(sigma))
        matrix = np.eye(len(scale)) + scale[:, None] * normal.matrix * scale
        return self._penalised(fit, pose, sigma) - 0.5 * float(np.linalg.slogdet(matrix)[1])


def all_free(effects: Sequence[Effect], which: Sequence[int], rings: int) -> tuple[Free, ...]:
    """Everything that can be fitted of the effects at some places; lists with one value a laser only if of `rings`."""
    found = []
    for place in which:
        if isinstance(effects[place], RoundingEffect):
            continue  # no residual tells of a step; see `lattice.py`
        for unknown in unknowns(type(effects[place])):
            length = np.size(getattr(effects[place], unknown.name))
            if unknown.rings == 1 or length == rings:
                found.append(Free(place, unknown))
    return tuple(found)


def _moved(effects: tuple[Effect, ...], free: Sequence[Free], step: np.ndarray) -> tuple[Effect, ...]:
    changed, at = list(effects), 0
    for one in free:
        value = np.asarray(getattr(changed[one.effect], one.unknown.name), float)
        part = step[at : at + one.unknown.rings]
        at += one.unknown.rings
        moved = value + (part if value.ndim else part[0])
        changed[one.effect] = with_values(changed[one.effect], {one.unknown.name: moved})
    return tuple(changed)

"""Fits parameters of effects to a sample, together with everything that is merely not known of the drive.

Gauss–Newton on the likelihood of `likelihood.py`; random effects (`random_effects.py`) are eliminated block by block,
so that a step of the parameters knows what they may take up, and their variances are estimated along.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from cosim.discrepancy.candidates import Unknown, unknowns, with_values
from cosim.discrepancy.data.sample import Prediction, Sample
from cosim.discrepancy.inference.columns import Column, SparseMatrix, scaled, stacked
from cosim.discrepancy.inference.likelihood import RISE_SIGMA_M, Fit, judge, range_spread_m
from cosim.discrepancy.inference.random_effects import Estimate, Factored, RandomEffects
from cosim.discrepancy.inference.score import Evidence, Quantity, change, dispersion
from cosim.discrepancy.inference.search import is_searched, searched
from cosim.discrepancy.settings import DEFAULT, Settings
from sensors.effects.base import Effect, RoundingEffect, ScanEffect

_GAIN = 0.05  # log-likelihood that a step must still bring
_STEPS = 12
_HALVINGS = 5
_LEAST_TOLD = 1e-5  # of what would be known of laser by laser without random effects; less is not told at all
_FAR_M, _FINE_M = 3.0, 0.01
_ROUGH, _ROUGH_SHARE = 8.0, 0.985
_RIDGE = 1e-9


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
        estimate: random effects and their variances.
        loglik: of the sample, random effects integrated out (Laplace).
        prediction: of the effects alone.
        fit, evidence: at the end, with random effects.
        columns: linearisation there, one for each of `free`.
    """

    effects: tuple[Effect, ...]
    free: tuple[Free, ...]
    estimate: Estimate
    loglik: float
    prediction: Prediction
    fit: Fit
    evidence: Evidence
    columns: tuple[Column, ...]


@dataclass(frozen=True, eq=False)
class _State:
    """Where a fit stands."""

    effects: tuple[Effect, ...]
    estimate: Estimate
    prediction: Prediction
    fit: Fit


class Fitter:
    """Fits effects to a sample.

    Args:
        sample: the measurements.
        settings: numbers that decide.

    Attributes:
        rings: how many there are.
        random: the sample's random effects.
    """

    def __init__(self, sample: Sample, settings: Settings = DEFAULT) -> None:
        self.sample, self.settings = sample, settings
        self.random = RandomEffects(sample, (settings.pose_shift_m, settings.pose_turn_rad))
        self.rings = int(sample.ring.max(initial=0)) + 1

    def fit(
        self,
        effects: Sequence[Effect],
        free: Sequence[Free],
        start: Estimate | None = None,
        *,
        steps: int = _STEPS,
        roughly: bool = False,
    ) -> Fitted:
        """Fit some parameters, starting from those the effects have.

        Args:
            effects: all effects of the sensor.
            free: what may change.
            start: random effects to start with; by default none but pose errors of the usual spread.
            steps: most Gauss–Newton steps.
            roughly: search no closer than it takes to tell candidates apart.
        """
        free = tuple(free)
        state = self._state(tuple(effects), self.random.start() if start is None else start)
        sought = [one.by_search or isinstance(one, ScanEffect) for one in state.effects]
        gradual = tuple(one for one in free if not sought[one.effect])
        state = self._settled(state, gradual, steps)
        found = self._searched(state, free, roughly)
        if found != state.effects:
            state = self._descended(self._state(found, state.estimate), (), 0.0, 3)
        return self._ended(state, free)

    def at(self, effects: Sequence[Effect], estimate: Estimate) -> Fitted:
        """Effects and random effects as they are, nothing fitted."""
        return self._ended(self._state(tuple(effects), estimate), ())

    def loss(self, estimate: Estimate) -> Callable[[tuple[Effect, ...]], float]:
        """Negative log-likelihood of effects, random effects as they are."""
        return lambda effects: -self._penalised(self._state(effects, estimate))

    def losses(self, effects: tuple[Effect, ...], estimate: Estimate) -> np.ndarray:
        """The part (n,) that every beam has in it."""
        return -self.sample.share * self._state(effects, estimate).fit.loglik

    def columns(
        self, effects: tuple[Effect, ...], free: Sequence[Free], at: Prediction, estimate: Estimate
    ) -> tuple[Column, ...]:
        """How the prediction changes with each free parameter, random effects as they are."""
        found, slope = [], self.random.light_slope(estimate)
        for one in free:
            effect, unknown = effects[one.effect], one.unknown
            value = np.asarray(getattr(effect, unknown.name), float)
            step = unknown.step if np.all(value + unknown.step <= unknown.high) else -unknown.step
            moved = with_values(effect, {unknown.name: value + step})
            after = self.sample.predict((*effects[: one.effect], moved, *effects[one.effect + 1 :]))
            delta: dict[Quantity, np.ndarray] = {
                name: values / step * (slope if name == "intensity" else 1.0)
                for name, values in change(at, after).items()
            }
            ring = self.sample.ring if unknown.rings > 1 else None
            found.append(Column(delta, ring, unknown.rings))
        return tuple(found)

    def system(self, fitted: Fitted) -> LinearModel:
        """The linear mixed model at a fit, residuals as wide as they are."""
        wider = dispersion(self.sample, fitted.fit)
        evidence = fitted.evidence if wider == (1.0, 1.0) else Evidence.of(self.sample, fitted.fit, wider=wider)
        return LinearModel.of(self, fitted.columns, evidence, fitted.prediction, fitted.estimate)

    def roughness(self, prediction: Prediction) -> float:
        """How far off ranges or rises are where they are far off [m]; 0 where all are within a few spreads."""
        compared = np.where(self.sample.compared, self.sample.along_m - prediction.range_m, np.nan)
        stated = float(np.median(range_spread_m(prediction)))
        return max(self._rough(compared, stated), self._rough(self.sample.above_m - prediction.rise_m, RISE_SIGMA_M))

    def _rough(self, residual_m: np.ndarray, stated_m: float) -> float:
        gap = np.abs(residual_m)
        near = np.isfinite(gap) & (gap < _FAR_M)
        if not near.any():
            return 0.0
        order = np.argsort(gap[near])
        below = np.cumsum(self.sample.weight[near][order])
        wide = float(gap[near][order][np.searchsorted(below, _ROUGH_SHARE * below[-1])])
        return wide if wide > _ROUGH * max(stated_m, _FINE_M) else 0.0

    def _state(self, effects: tuple[Effect, ...], estimate: Estimate, blur: float = 0.0) -> _State:
        with np.errstate(over="ignore", invalid="ignore"):  # a trial may ask for the impossible, and be refused
            prediction = self.sample.predict(effects)
        return _State(effects, estimate, prediction, self._judged(prediction, estimate, blur))

    def _judged(self, prediction: Prediction, estimate: Estimate, blur: float = 0.0) -> Fit:
        return judge(self.sample, self.random.adjusted(prediction, estimate), blur)

    def _ended(self, state: _State, free: tuple[Free, ...]) -> Fitted:
        columns = self.columns(state.effects, free, state.prediction, state.estimate)
        evidence = Evidence.of(self.sample, state.fit)
        loglik = self._marginal(state, evidence)
        return Fitted(state.effects, free, state.estimate, loglik, state.prediction, state.fit, evidence, columns)

    def _searched(self, state: _State, free: tuple[Free, ...], roughly: bool) -> tuple[Effect, ...]:
        """With numbers that no slope tells of, such as hard limits, where they are likeliest."""
        columns = self.columns(state.effects, free, state.prediction, state.estimate)
        which = [
            (one.effect, one.unknown, column)
            for one, column in zip(free, columns, strict=True)
            if state.effects[one.effect].by_search or is_searched(state.effects[one.effect], one.unknown, column)
        ]
        if not which:
            return state.effects
        return searched(state.effects, which, self.loss(state.estimate), self.sample, state.fit, roughly=roughly)

    def _settled(self, start: _State, free: tuple[Free, ...], steps: int) -> _State:
        """Where Gauss–Newton steps lead; where that is still far off, or where they lead through widened ranges."""
        state = self._descended(start, free, 0.0, steps)
        wide = self.roughness(self.random.adjusted(state.prediction, state.estimate))
        if not wide or not free:
            return state
        other = start
        while wide > 0:
            other = self._descended(other, free, wide, steps)
            wide = wide / 4 if wide / 4 > _FINE_M else 0.0
        other = self._descended(other, free, 0.0, steps)
        return max(state, other, key=lambda one: self._marginal(one, Evidence.of(self.sample, one.fit)))

    def _descended(self, state: _State, free: tuple[Free, ...], blur: float, steps: int) -> _State:
        """Gauss–Newton steps at one blur, variances updated along."""
        state = replace(state, fit=self._judged(state.prediction, state.estimate, blur))
        for number in range(steps):
            value = self._penalised(state)
            evidence = Evidence.of(self.sample, state.fit, blur).reweighted(state.fit)
            if blur == 0.0 and number in (1, 2, 4):
                begun = self.random.begun(state.estimate, state.prediction, evidence, self.settings.variance_sigmas)
                state = replace(state, estimate=begun)
            columns = self.columns(state.effects, free, state.prediction, state.estimate)
            model = LinearModel.of(self, columns, evidence, state.prediction, state.estimate)
            step, change_u = model.step(state.estimate, self._least_told(free))
            if not (np.isfinite(step).all() and np.isfinite(change_u).all()):
                break
            gained = -np.inf
            for halving in range(_HALVINGS):
                part = 0.5**halving
                moved = replace(state.estimate, u=state.estimate.u + part * change_u)
                trial = self._state(_moved(state.effects, free, part * step), moved, blur)
                reached = self._penalised(trial)
                if reached > value:
                    gained, state = reached - value, trial
                    break
            after = self.random.updated(state.estimate, model.known)
            settled = bool(np.all(np.abs(after.variance - state.estimate.variance) <= 0.1 * after.variance + 1e-12))
            state = replace(state, estimate=after)
            if gained < max(_GAIN, 1e-7 * abs(value)) and (settled or number + 1 >= steps) and number >= 2:
                break
        return state

    def _least_told(self, free: Sequence[Free]) -> float:
        """See `LinearModel.step`: of lists on a map made of the scans, which tells no gain that all lasers share."""
        lists = any(one.unknown.rings > 1 for one in free)
        return _LEAST_TOLD if lists and self.sample.of_own_map else 0.0

    def _penalised(self, state: _State) -> float:
        law = state.estimate.u**2 @ np.where(
            self.random.active(state.estimate), self.random.precision(state.estimate), 0
        )
        return float(self.sample.share @ state.fit.loglik) - 0.5 * float(law)

    def _marginal(self, state: _State, evidence: Evidence) -> float:
        model = LinearModel.of(self, (), evidence, state.prediction, state.estimate)
        return self._penalised(state) - 0.5 * model.shrinkage()


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A mixed model, linear about a fit: `score ≈ X β + Z u`, u of known precision.

    Attributes:
        x: (n, p) columns of the fitted parameters by quantity.
        z: (n, a) columns of the active random effects by quantity.
        used: (a,) which random effects these are.
        precision: (a,) of their laws.
        known: (a, a) information of z.
        solver: of `known` and the precision.
        evidence: scores and informations.
    """

    x: dict[Quantity, SparseMatrix]
    z: dict[Quantity, SparseMatrix]
    used: np.ndarray
    precision: np.ndarray
    known: SparseMatrix
    solver: Factored | None
    evidence: Evidence

    @classmethod
    def of(
        cls,
        fitter: Fitter,
        columns: Sequence[Column],
        evidence: Evidence,
        prediction: Prediction,
        estimate: Estimate,
    ) -> LinearModel:
        """About a prediction and random effects."""
        random = fitter.random
        used = np.flatnonzero(random.active(estimate))
        designs = random.designs(prediction, estimate)
        z: dict[Quantity, SparseMatrix] = {
            name: one.tocsc()[:, used].tocsr() for name, one in designs.items() if name in evidence.score
        }
        known = sparse.csr_matrix((len(used), len(used)))
        for name, one in z.items():
            if one.nnz:
                known = known + one.T @ scaled(one, evidence.information[name])
        precision = random.precision(estimate)[used]
        solver = Factored(known + sparse.diags(precision), random.apart[used]) if len(used) else None
        x = stacked(columns, evidence.score, len(fitter.sample))
        return cls(x, z, used, precision, known, solver, evidence)

    def projected(self, columns: dict[Quantity, SparseMatrix]) -> tuple[np.ndarray, np.ndarray]:
        """How much of each random effect and parameter a unit of columns (n, k) is worth, (a + p, k).

        Beside it the information that the columns share with them, (a + p, k).
        """
        shared = self._shared(columns, self.z, len(self.used))
        of_x = self._shared(columns, self.x, self.parameters)
        random, fixed = self._solve(shared), np.zeros((0, shared.shape[1]))
        if self.parameters:
            fixed = np.linalg.solve(self.fixed_information, of_x - self._across.T @ random)
            random = random - self._across_solved @ fixed
        return np.vstack([random, fixed]), np.vstack([shared, of_x])

    @cached_property
    def parameters(self) -> int:
        """p."""
        return next(iter(self.x.values())).shape[1] if self.x else 0

    @cached_property
    def fixed_information(self) -> np.ndarray:
        """(p, p) information of the parameters, random effects eliminated."""
        matrix = self._own_information - self._across.T @ self._across_solved
        return matrix + np.diag(_RIDGE * np.diag(matrix) + 1e-12)

    def beside(self, columns: dict[Quantity, SparseMatrix]) -> LinearModel:
        """The same with further parameters, (n, k) columns by quantity."""
        rows = len(next(iter(self.evidence.score.values())))
        width = next(iter(columns.values())).shape[1]
        x: dict[Quantity, SparseMatrix] = {}
        both: set[Quantity] = {*self.x, *columns}
        for name in both:
            own = self.x.get(name, sparse.csr_matrix((rows, self.parameters)))
            more = columns.get(name, sparse.csr_matrix((rows, width)))
            x[name] = sparse.hstack([own, more], format="csr")
        return replace(self, x=x)

    def step(self, estimate: Estimate, least_told: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """A Gauss–Newton step of parameters (p,) and of all random effects (m,).

        Args:
            estimate: random effects as they are.
            least_told: share of the information about a direction of the parameters that random effects must leave;
                with less the step does not go that way, as there is nothing to tell how far.
        """
        right = self._scored(self.z, len(self.used)) - self.precision * estimate.u[self.used]
        step = np.zeros(self.parameters)
        if self.parameters:
            step = self._told(self._scored(self.x, self.parameters) - self._across.T @ self._solve(right), least_told)
        change = np.zeros(len(estimate.u))
        change[self.used] = self._solve(right - self._across @ step)
        return step, change

    def _told(self, slope: np.ndarray, least: float) -> np.ndarray:
        """The step (p,) of a slope (p,), along directions of which random effects leave a share of what is known."""
        if not least:
            return np.linalg.solve(self.fixed_information, slope)
        known = np.diag(self._own_information)
        scale = np.sqrt(np.where(known > 0, known, 1.0))
        both = np.outer(scale, scale)
        own = self._own_information / both + _RIDGE * np.eye(len(scale))
        share, way = linalg.eigh(self.fixed_information / both, own)
        way, share = way[:, share > least], share[share > least]
        return way @ ((way.T @ (slope / scale)) / share) / scale

    def shrinkage(self) -> float:
        """log |I + D^½ ZᵀWZ D^½|: what the freedom of the random effects costs."""
        if self.solver is None:
            return 0.0
        return self.solver.log_determinant() - float(np.log(self.precision).sum())

    @cached_property
    def _own_information(self) -> np.ndarray:
        """(p, p) information of the parameters, random effects known."""
        return self._shared(self.x, self.x, self.parameters)

    @cached_property
    def _across(self) -> np.ndarray:
        """(a, p) information shared by random effects and parameters."""
        return self._shared(self.x, self.z, len(self.used))

    @cached_property
    def _across_solved(self) -> np.ndarray:
        return self._solve(self._across)

    def _solve(self, right: np.ndarray) -> np.ndarray:
        return right if self.solver is None or not right.size else self.solver.solve(right)

    def _shared(
        self, columns: dict[Quantity, SparseMatrix], own: dict[Quantity, SparseMatrix], size: int
    ) -> np.ndarray:
        width = next(iter(columns.values())).shape[1] if columns else 0
        found = np.zeros((size, width))
        for name, one in columns.items():
            if name in own and own[name].nnz and one.nnz and name in self.evidence.information:
                found += (own[name].T @ scaled(one, self.evidence.information[name])).toarray()
        return found

    def _scored(self, own: dict[Quantity, SparseMatrix], size: int) -> np.ndarray:
        found = np.zeros(size)
        for name, one in own.items():
            found += one.T @ self.evidence.score[name]
        return found


def all_free(effects: Sequence[Effect], which: Sequence[int], rings: int) -> tuple[Free, ...]:
    """Everything that can be fitted of the effects at some places; lists with one value a laser only if of `rings`."""
    found = []
    for place in which:
        if isinstance(effects[place], RoundingEffect):
            continue  # no residual tells of a step; see `quantization.py`
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

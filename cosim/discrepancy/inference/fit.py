"""Fits parameters of effects to a sample, together with everything that is merely not known of the drive.

Gauss–Newton on the likelihood of `likelihood.py`; random effects (`random_effects.py`) are eliminated block by block,
so that a step of the parameters knows what they may take up, and their variances are estimated along.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.candidates import Unknown, unknowns, with_values
from cosim.discrepancy.inference.dependence import (
    Dependence,
    apply_changes,
    changes_of,
    channel_slopes,
    spurious_densities,
)
from cosim.discrepancy.inference.likelihood import Residuals, range_spread_m, residuals_of
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.inference.score import Column, Evidence, Quantity, change, dispersion
from cosim.discrepancy.inference.search import is_searched, searched
from cosim.discrepancy.sampling.sample import Prediction, Sample
from sensors.effects.base import BeamEffect, Effect, NoiseEffect, RoundingEffect, ScanEffect

_REMEMBERED = 4  # models whose columns are kept


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
        residuals, evidence: at the end, with random effects.
        columns: linearisation there, one for each of `free` and of the dependences that have derivatives.
        dependences: fitted along, acting on what the effects predict.
        bare: prediction of the effects without the dependences.
    """

    effects: tuple[Effect, ...]
    free: tuple[Free, ...]
    estimate: Estimate
    loglik: float
    prediction: Prediction
    residuals: Residuals
    evidence: Evidence
    columns: tuple[Column, ...]
    dependences: tuple[Dependence, ...]
    bare: Prediction


@dataclass(frozen=True, eq=False)
class _State:
    """Where a fit stands."""

    effects: tuple[Effect, ...]
    dependences: tuple[Dependence, ...]
    estimate: Estimate
    bare: Prediction
    prediction: Prediction
    residuals: Residuals


class SlopeMemory:
    """Columns of effects' parameters, and where they were computed."""

    def __init__(self) -> None:
        self._about: list[tuple[tuple[Effect, ...], dict[Free, Column]]] = []

    def columns(self, effects: tuple[Effect, ...], free: Sequence[Free], *, simplified: bool) -> dict[Free, Column]:
        """Columns known near these effects; those that are added to the result are known from then on.

        Args:
            effects: of the model.
            free: its free parameters.
            simplified: whether columns of a model that lacks the last effects will do.
        """
        for about, columns in self._about:
            if _is_same_but_for(about, effects, free) and not _is_away(about, effects, free):
                return columns
        known: dict[Free, Column] = {}
        for about, columns in self._about if simplified else ():
            start, old = effects[: len(about)], [one for one in free if one.effect < len(about)]
            if _is_same_but_for(about, start, old) and not _is_away(about, start, old):
                known = dict(columns)
                break
        self._about = [(effects, known), *self._about[: _REMEMBERED - 1]]
        return known


def _is_same_but_for(about: tuple[Effect, ...], effects: tuple[Effect, ...], free: Sequence[Free]) -> bool:
    """Whether two models differ in values of free parameters only."""
    if len(about) != len(effects):
        return False
    names: dict[int, set[str]] = {}
    for one in free:
        names.setdefault(one.effect, set()).add(one.unknown.name)
    for index, (old, new) in enumerate(zip(about, effects, strict=True)):
        if type(old) is not type(new):
            return False
        if old != new and old.model_dump(exclude=names.get(index)) != new.model_dump(exclude=names.get(index)):
            return False
    return True


class Fitter:
    """Fits effects to a sample.

    Args:
        sample: the measurements.

    Attributes:
        settings: those of the sample.
        rings: how many there are.
        random: the sample's random effects.
    """

    def __init__(self, sample: Sample) -> None:
        self.sample, self.settings = sample, sample.settings
        self.random = RandomEffects(sample)
        self.rings = int(sample.ring.max(initial=0)) + 1
        self._slopes = SlopeMemory()

    def fit(
        self,
        effects: Sequence[Effect],
        free: Sequence[Free],
        start: Estimate | None = None,
        *,
        steps: int | None = None,
        roughly: bool = False,
        dependences: Sequence[Dependence] = (),
        widened: bool = True,
        simplified: bool = False,
    ) -> Fitted:
        """Fit some parameters, starting from those the effects have.

        Args:
            effects: all effects of the sensor.
            free: what may change.
            start: random effects to start with, but for pose errors where it is likelier without; by default none but
                pose errors of the usual spread.
            steps: most Gauss–Newton steps.
            roughly: search no closer than it takes to tell candidates apart.
            dependences: whose coefficients are fitted along.
            widened: whether ranges that are far off are first compared with a wider spread; superfluous where a fit
                starts from one of the same ranges.
            simplified: whether derivatives of a model that lacks the last effects are good enough for the steps.
        """
        free, dependences = tuple(free), tuple(dependences)
        state = self._state(tuple(effects), self.random.start() if start is None else start, dependences=dependences)
        if self.random.has_poses:  # an effect that is new may have taken over what pose errors were
            u = np.where(np.arange(self.random.size) < self.random.rows("poses").stop, 0.0, state.estimate.u)
            none = replace(state.estimate, u=u)
            other = replace(state, estimate=none, residuals=self.residuals(state.prediction, none))
            state = max(state, other, key=self._penalised)
        sought = [one.by_search or isinstance(one, ScanEffect) for one in state.effects]
        gradual = tuple(one for one in free if not sought[one.effect])
        steps = self.settings.descent.steps if steps is None else steps
        if widened:
            state = self._settled(state, gradual, steps, simplified)
        else:
            state = self._descended(state, gradual, 0.0, steps, simplified)
        found = self._searched(state, free, roughly)
        if found != state.effects:
            state = self._state(found, state.estimate, dependences=state.dependences)
            state = self._descended(state, (), 0.0, 3)
        return self._ended(state, free)

    def at(self, effects: Sequence[Effect], estimate: Estimate, dependences: Sequence[Dependence] = ()) -> Fitted:
        """Effects, dependences and random effects as they are, nothing fitted."""
        return self._ended(self._state(tuple(effects), estimate, dependences=tuple(dependences)), ())

    def loss(
        self, estimate: Estimate, dependences: tuple[Dependence, ...] = ()
    ) -> Callable[[tuple[Effect, ...]], float]:
        """Negative log-likelihood of effects, random effects and dependences as they are."""
        return lambda effects: -self._penalised(self._state(effects, estimate, dependences=dependences))

    def losses(self, effects: tuple[Effect, ...], estimate: Estimate) -> np.ndarray:
        """The part (n,) that every beam has in it."""
        return -self.sample.share * self._state(effects, estimate).residuals.loglik

    def passed_on(self, slopes: Sequence[Column], at: Prediction, estimate: Estimate) -> tuple[Column, ...]:
        """Slopes as they come out beside the random effects: how the prediction changes with each free parameter."""
        by = self.random.passed_on(at, estimate)
        return tuple(
            replace(one, delta={name: values * by.get(name, 1.0) for name, values in one.delta.items()})
            for one in slopes
        )

    def slopes(
        self, effects: tuple[Effect, ...], free: Sequence[Free], at: Prediction, *, simplified: bool = False
    ) -> tuple[Column, ...]:
        """How what effects predict changes with each free parameter.

        Columns that were computed where no parameter was further away than its step are used again; `simplified` also
        those of a model that lacked the last effects.
        """
        known = self._slopes.columns(effects, free, simplified=simplified)
        for one in free:
            if one not in known:
                known[one] = self._slope(effects, one, at)
        return tuple(known[one] for one in free)

    def _slope(self, effects: tuple[Effect, ...], one: Free, at: Prediction) -> Column:
        """How what effects predict changes with one free parameter, by a difference."""
        effect, unknown = effects[one.effect], one.unknown
        value = np.asarray(getattr(effect, unknown.name), float)
        step = unknown.step if np.all(value + unknown.step <= unknown.high) else -unknown.step
        after, before = self._moved(effects, one, value + step), at
        if isinstance(effect, BeamEffect) and np.all(np.clip(value - step, unknown.low, unknown.high) == value - step):
            # Ground at a flat angle is far from linear: such slopes are taken from both sides.
            before, step = self._moved(effects, one, value - step), 2 * step
        delta: dict[Quantity, np.ndarray] = {
            name: values / step for name, values in change(before, after, self.settings.law).items()
        }
        return Column(delta, self.sample.ring if unknown.rings > 1 else None, unknown.rings)

    def _moved(self, effects: tuple[Effect, ...], one: Free, value: np.ndarray) -> Prediction:
        """What is expected with another value of a parameter."""
        moved = with_values(effects[one.effect], {one.unknown.name: value})
        return self.sample.predict((*effects[: one.effect], moved, *effects[one.effect + 1 :]))

    def system(self, fitted: Fitted) -> LinearModel:
        """The linear mixed model at a fit, residuals as wide as they are."""
        wider = dispersion(self.sample, fitted.residuals)
        evidence = fitted.evidence if wider == (1.0, 1.0) else Evidence.of(self.sample, fitted.residuals, wider=wider)
        return LinearModel.of(self.random, fitted.columns, evidence, fitted.prediction, fitted.estimate)

    def roughness(self, prediction: Prediction) -> float:
        """How far off ranges or rises are where they are far off [m]; 0 where all are within a few spreads."""
        compared = np.where(self.sample.compared, self.sample.along_m - prediction.range_m, np.nan)
        stated = float(np.median(range_spread_m(prediction, self.settings.law)))
        rise = self.sample.above_m - prediction.rise_m
        return max(self._rough(compared, stated), self._rough(rise, self.settings.law.rise_sigma_m))

    def _rough(self, residual_m: np.ndarray, stated_m: float) -> float:
        gap, by = np.abs(residual_m), self.settings.descent
        near = np.isfinite(gap) & (gap < by.far_m)
        if not near.any():
            return 0.0
        order = np.argsort(gap[near])
        below = np.cumsum(self.sample.weight[near][order])
        wide = float(gap[near][order][np.searchsorted(below, by.rough_share * below[-1])])
        return wide if wide > by.rough * max(stated_m, by.fine_m) else 0.0

    def is_searched(self, effect: Effect, unknown: Unknown, column: Column) -> bool:
        """Whether a parameter is found by search."""
        return is_searched(effect, unknown, column, self.settings.search)

    def _state(
        self,
        effects: tuple[Effect, ...],
        estimate: Estimate,
        blur: float = 0.0,
        dependences: tuple[Dependence, ...] = (),
    ) -> _State:
        with np.errstate(over="ignore", invalid="ignore"):  # a trial may ask for the impossible, and be refused
            bare = self.sample.predict(effects)
        prediction = apply_changes(self.sample, bare, changes_of(dependences)) if dependences else bare
        return _State(effects, dependences, estimate, bare, prediction, self.residuals(prediction, estimate, blur))

    def _columns(
        self, state: _State, free: tuple[Free, ...], slopes: Sequence[Column] | None = None
    ) -> tuple[Column, ...]:
        """Derivatives of the adjusted prediction: of the free parameters, then of the dependences' coefficients."""
        slopes = self.slopes(state.effects, free, state.bare) if slopes is None else slopes
        columns: list[Column] = list(self.passed_on(slopes, state.prediction, state.estimate))
        if state.dependences:
            by = self.random.passed_on(state.prediction, state.estimate)
            of_channel = channel_slopes(
                self.sample, state.bare, changes_of(state.dependences), [one.channel for one in state.dependences]
            )
            for dependence in state.dependences:
                delta = of_channel.get(dependence.channel, {})
                adjusted: dict[Quantity, np.ndarray] = {
                    name: values * by.get(name, 1.0) for name, values in delta.items()
                }
                columns.append(Column(adjusted, rings=dependence.size, basis=dependence.basis))
        return tuple(columns)

    def residuals(self, prediction: Prediction, estimate: Estimate, blur: float = 0.0) -> Residuals:
        """How a prediction fits, changed as random effects do; `blur` as of `judge`."""
        return residuals_of(self.sample, self.random.adjusted(prediction, estimate), blur)

    def residuals_at(self, adjusted: Prediction) -> Residuals:
        """How a prediction that random effects have changed fits."""
        return residuals_of(self.sample, adjusted)

    def _ended(self, state: _State, free: tuple[Free, ...]) -> Fitted:
        columns = self._columns(state, free)
        evidence = Evidence.of(self.sample, state.residuals)
        loglik = self._marginal(state, evidence)
        return Fitted(
            state.effects, free, state.estimate, loglik, state.prediction, state.residuals, evidence, columns,
            state.dependences, state.bare,
        )  # fmt: skip

    def _searched(self, state: _State, free: tuple[Free, ...], roughly: bool) -> tuple[Effect, ...]:
        """With numbers that no slope tells of, such as hard limits, where they are likeliest."""
        columns = self.passed_on(self.slopes(state.effects, free, state.bare), state.prediction, state.estimate)
        which = [
            (one.effect, one.unknown, column)
            for one, column in zip(free, columns, strict=True)
            if state.effects[one.effect].by_search or self.is_searched(state.effects[one.effect], one.unknown, column)
        ]
        if not which:
            return state.effects
        return searched(
            state.effects,
            which,
            self.loss(state.estimate, state.dependences),
            self.sample,
            state.residuals,
            roughly=roughly,
        )

    def _settled(self, start: _State, free: tuple[Free, ...], steps: int, simplified: bool) -> _State:
        """Where Gauss–Newton steps lead; where that is still far off, or where they lead through widened ranges."""
        state = self._descended(start, free, 0.0, steps, simplified)
        wide = self.roughness(self.random.adjusted(state.prediction, state.estimate))
        if not wide:
            return state
        other = start
        while wide > 0:
            other = self._descended(other, free, wide, steps, simplified)
            wide = wide / 4 if wide / 4 > self.settings.descent.fine_m else 0.0
        other = self._descended(other, free, 0.0, steps, simplified)
        return max(state, other, key=lambda one: self._marginal(one, Evidence.of(self.sample, one.residuals)))

    def _descended(
        self, state: _State, free: tuple[Free, ...], blur: float, steps: int, simplified: bool = False
    ) -> _State:
        """Gauss–Newton steps at one blur, variances updated along."""
        state, about = replace(state, residuals=self.residuals(state.prediction, state.estimate, blur)), None
        slopes: tuple[Column, ...] = ()
        lasers = self._of_lasers(state.effects, free)
        precision = np.zeros(len(lasers))

        def worth(one: _State) -> float:
            return self._penalised(one) - 0.5 * float(precision @ _away(one.effects, free) ** 2)

        for number in range(steps):
            state = self._lit(state, blur)
            value = worth(state)
            evidence = Evidence.of(self.sample, state.residuals, blur).reweighted(state.residuals, self.settings.law)
            if blur == 0.0 and number in (1, 2, 4):
                begun = self.random.begun(state.estimate, state.prediction, evidence)
                state = replace(state, estimate=begun)
            if about is None or _is_away(about, state.effects, free):
                about, slopes = state.effects, self.slopes(state.effects, free, state.bare, simplified=simplified)
            columns = self._columns(state, free, slopes)
            model = LinearModel.of(self.random, columns, evidence, state.prediction, state.estimate)
            law = self._prior(model, state, precision, _away(state.effects, free))
            step, change_u = model.step(state.estimate, self._least_told(free), law)
            step, change_c = step[: len(lasers)], step[len(lasers) :]
            step = self._without_common_gain(state.effects, free, step)
            if not all(np.isfinite(part).all() for part in (step, change_u, change_c)):
                break
            state = self._with_shares(state, blur)
            gained, still = -np.inf, self._still(state.effects, free)
            for halving in range(self.settings.descent.halvings):
                part = 0.5**halving
                moved = replace(state.estimate, u=state.estimate.u + part * change_u)
                terms = _moved_dependences(state.dependences, part * change_c)
                tried = [
                    self._state(_moved(state.effects, free, part * own * step), moved, blur, terms) for own in still
                ]
                trial = max((self._lit(one, blur, state.estimate) for one in tried), key=worth)
                reached = worth(trial)
                if reached > value:
                    gained, state = reached - value, trial
                    break
            if lasers.any():
                known = model.fixed_information[: len(lasers), : len(lasers)] + np.diag(precision)
                precision = _laws(lasers, _away(state.effects, free), known)
            after = self.random.updated(state.estimate, model.solver)
            settled = bool(np.all(np.abs(after.variance - state.estimate.variance) <= 0.1 * after.variance + 1e-12))
            state = replace(state, estimate=after)
            if (
                gained < max(self.settings.descent.gain, 1e-7 * abs(value))
                and (settled or number + 1 >= steps)
                and number >= 2
            ):
                break
        return state

    def _prior(
        self, model: LinearModel, state: _State, precision: np.ndarray, away: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Precisions of normal priors of all parameters and their distances from the means, see `LinearModel.step`.

        Coefficients of dependences get a weak one, so that those that the data cannot determine stay at 0.
        """
        if not state.dependences:
            return (precision, away) if precision.any() else None
        coefficients = np.concatenate([one.coefficients for one in state.dependences])
        known = np.maximum(model.own_information_diagonal[len(precision) :], 0.0)
        weak = self.settings.descent.ridge * known + 1e-9
        weak[known <= 0] = 1.0
        return np.append(precision, weak), np.append(away, coefficients)

    def _with_shares(self, state: _State, blur: float) -> _State:
        """With one step of expectation maximisation for the shares of spurious returns."""
        if not any(one.is_one_sided for one in state.dependences):
            return state
        sample, share = self.sample, self.sample.share * self.sample.compared * self.sample.first
        density = spurious_densities(sample, state.prediction)
        likelihood = np.exp(self.residuals(state.prediction, state.estimate, blur).outcome)
        dependences = []
        for one in state.dependences:
            if one.is_one_sided:
                start = np.where(one.coefficients > 0, one.coefficients, self.settings.law.stray_share)
                new = one.basis.T @ (share * density[one.channel] / likelihood)
                start = start * new / np.maximum(one.basis.T @ share, 1e-9)
                one = replace(one, coefficients=start)
            dependences.append(one)
        return self._state(state.effects, state.estimate, blur, tuple(dependences))

    def _lit(self, state: _State, blur: float, other: Estimate | None = None) -> _State:
        """With each surface of a map made of the scans as bright as is likeliest, all else as it is.

        Tried is what surfaces have in another estimate, by default multiples of what they have: noise grows with
        brightness, so that slopes lead astray where a surface is dark or of two kinds.
        """
        rows, sample = self.random.rows("albedo_of_map"), self.sample
        if not sample.of_own_map or rows.stop == rows.start:
            return state
        bright, darkest = 1 + state.estimate.u[rows], self.settings.unsure.darkest
        tries = [1 + other.u[rows]] if other else [by * bright for by in self.settings.descent.brightnesses]
        cell, used = np.maximum(sample.surface, 0), sample.share * (sample.surface >= 0)

        def tried(bright: np.ndarray) -> tuple[_State, np.ndarray]:
            estimate = replace(state.estimate, u=state.estimate.u.copy())
            estimate.u[rows] = bright - 1
            lit = replace(state, estimate=estimate, residuals=self.residuals(state.prediction, estimate, blur))
            return lit, np.bincount(cell, used * lit.residuals.loglik, len(bright))

        best, reached = bright, np.bincount(cell, used * state.residuals.loglik, len(bright))
        for trial in (np.maximum(one, darkest) for one in tries):
            value = tried(trial)[1]
            best, reached = np.where(value > reached, trial, best), np.maximum(value, reached)
        return tried(best)[0]

    def _without_common_gain(self, effects: tuple[Effect, ...], free: Sequence[Free], step: np.ndarray) -> np.ndarray:
        """A step (p,) in which lasers get brighter only beside each other: what all share is the map's reflectance."""
        step, at = step.copy(), 0
        for one in free:
            part = step[at : at + one.unknown.rings]
            if one.unknown.rings > 1 and self.sample.of_own_map and effects[one.effect].channel == "intensity":
                part -= part.mean()
            at += one.unknown.rings
        return step

    def _of_lasers(self, effects: tuple[Effect, ...], free: Sequence[Free]) -> np.ndarray:
        """(p,) int: which list with a number a laser each parameter is of, from 1; 0 for others, and off own maps.

        On a map made of the scans level ground does not tell beams that look lower in proportion to their slopes from a
        sensor that sits higher: so numbers of lasers are deviates of a normal law, as small as the data let them be.
        """
        lists = [bool(one.unknown.rings > 1 and self.sample.of_own_map and type(effects[one.effect]).neutral)
                 for one in free]  # fmt: skip
        return np.repeat(np.cumsum(lists, dtype=int) * lists, [one.unknown.rings for one in free])

    def _still(self, effects: tuple[Effect, ...], free: Sequence[Free]) -> list[np.ndarray]:
        """Shares (p,) of a step that are tried: all; on maps of the scans also none of noise, told by neighbours."""
        rings = np.array([one.unknown.rings for one in free], int)
        others = np.repeat([float(not isinstance(effects[one.effect], NoiseEffect)) for one in free], rings)
        return [np.ones(len(others)), *([others] if self.sample.of_own_map and not others.all() else [])]

    def _least_told(self, free: Sequence[Free]) -> float:
        """See `LinearModel.step`: of lists on a map made of the scans, which tells no gain that all lasers share."""
        lists = any(one.unknown.rings > 1 for one in free)
        return self.settings.descent.least_told if lists and self.sample.of_own_map else 0.0

    def _penalised(self, state: _State) -> float:
        law = state.estimate.u**2 @ np.where(
            self.random.active(state.estimate), self.random.precision(state.estimate), 0
        )
        return float(self.sample.share @ state.residuals.loglik) - 0.5 * float(law)

    def _marginal(self, state: _State, evidence: Evidence) -> float:
        model = LinearModel.of(self.random, (), evidence, state.prediction, state.estimate)
        return self._penalised(state) - 0.5 * model.shrinkage()


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


def _moved_dependences(dependences: Sequence[Dependence], step: np.ndarray) -> tuple[Dependence, ...]:
    """Dependences with a step (c,) of all their coefficients; shares of spurious returns are fitted elsewhere."""
    moved, at = [], 0
    for one in dependences:
        part = 0.0 if one.is_one_sided else step[at : at + one.size]
        moved.append(replace(one, coefficients=one.coefficients + part))
        at += one.size
    return tuple(moved)


def _away(effects: tuple[Effect, ...], free: Sequence[Free]) -> np.ndarray:
    """How far lists with a number a laser are from doing nothing (p,); 0 of other parameters."""
    found = [np.zeros(0)]
    for one in free:
        effect, name, away = effects[one.effect], one.unknown.name, np.zeros(one.unknown.rings)
        if one.unknown.rings > 1 and effect.neutral is not None:
            away = np.asarray(getattr(effect, name), float) - np.ravel(effect.neutral[name])[0]
        found.append(away)
    return np.concatenate(found)


def _laws(lasers: np.ndarray, away: np.ndarray, information: np.ndarray) -> np.ndarray:
    """Precisions (p,) of the laws of lists, one step towards the likeliest (EM: Dempster, Laird and Rubin, 1977)."""
    spread = away**2 + np.diag(np.linalg.pinv(information, hermitian=True))
    found = np.zeros(len(lasers))
    for one in range(1, int(lasers.max()) + 1):
        found[lasers == one] = 1 / max(float(spread[lasers == one].mean()), 1e-12)
    return found


def _is_away(about: tuple[Effect, ...], effects: tuple[Effect, ...], free: Sequence[Free]) -> bool:
    """Whether a parameter has moved so far that slopes about where it was tell too little."""
    moves = [
        np.subtract(*(getattr(all_of[one.effect], one.unknown.name) for all_of in (about, effects))) for one in free
    ]
    return any(np.any(np.abs(move) > one.unknown.step) for move, one in zip(moves, free, strict=True))


def _moved(effects: tuple[Effect, ...], free: Sequence[Free], step: np.ndarray) -> tuple[Effect, ...]:
    changed, at = list(effects), 0
    for one in free:
        value = np.asarray(getattr(changed[one.effect], one.unknown.name), float)
        part = step[at : at + one.unknown.rings]
        at += one.unknown.rings
        moved = value + (part if value.ndim else part[0])
        changed[one.effect] = with_values(changed[one.effect], {one.unknown.name: moved})
    return tuple(changed)

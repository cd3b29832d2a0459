"""Fit effect parameters to a sample of beams jointly with the random effects of the drive.

Gauss–Newton on the likelihood in `likelihood.py`. The random effects (`random_effects.py`: poses, objects, map, albedo)
are eliminated block by block (Schur complement), so that a parameter step accounts for what they can absorb; their
variances are estimated in the same iterations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.candidates import Unknown
from cosim.discrepancy.inference.dependence import (
    Dependence,
    apply_changes,
    changes_of,
    channel_slopes,
    moved_dependences,
    updated_spurious_shares,
)
from cosim.discrepancy.inference.derivatives import Derivatives
from cosim.discrepancy.inference.inflation import inflations_of
from cosim.discrepancy.inference.likelihood import Residuals, residuals_of
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.map_albedo import updated_map_albedo
from cosim.discrepancy.inference.parameters import (
    Free,
    acts_on_spreads,
    apply_step,
    deviations,
    has_moved,
    list_numbers,
    step_limits,
    updated_prior_precisions,
    without_common_gain,
)
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.inference.score import Column, Evidence, Quantity
from cosim.discrepancy.inference.search import is_searched, search_parameters
from cosim.discrepancy.inference.surface_spread import updated_surface_spread
from cosim.discrepancy.sampling.sample import Prediction, Sample
from sensors.effects.base import Effect, ScanEffect


@dataclass(frozen=True, eq=False)
class Fitted:
    """Result of a fit.

    Attributes:
        effects: effects with their fitted parameters.
        free: parameters that were fitted.
        estimate: random effects and their variances.
        loglik: log-likelihood of the sample with the random effects integrated out (Laplace approximation).
        prediction: prediction of effects and dependences, without random effects.
        residuals, evidence: residuals and scores at the optimum, with random effects.
        columns: derivatives of the prediction at the optimum: one column per entry of `free`, then one per dependence
            (empty for dependences on spurious returns).
        dependences: dependences that were fitted jointly; they act on the prediction of the effects.
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


# Damping and length of the Gauss–Newton steps that are tried until the likelihood rises, and whether spreads change.
# Scores of spreads come from differences of neighbouring beams, and are no derivative of this likelihood: the other
# parameters must be able to move without them, but not where candidates are ranked: their gains are compared with the
# same spreads. The first attempt comes before the one that was successful last.
_ATTEMPTS = (
    (0.0, 1.0, True), (0.0, 1.0, False), (0.0, 0.5, True), (0.0, 0.25, True),
    (0.01, 1.0, True), (0.1, 1.0, True), (1.0, 1.0, True), (10.0, 1.0, True),
)  # fmt: skip
_MOST_FAILURES = 2  # successive steps without any rise, between which the variances were updated


@dataclass(frozen=True, eq=False)
class _State:
    """Current state of a fit; attributes as in `Fitted`."""

    effects: tuple[Effect, ...]
    dependences: tuple[Dependence, ...]
    estimate: Estimate
    bare: Prediction
    prediction: Prediction
    residuals: Residuals


class Fitter:
    """Fits effects to a sample.

    Args:
        sample: sample of measured beams.

    Attributes:
        settings: settings of the sample.
        rings: number of rings.
        random: random effects of the sample.
    """

    def __init__(self, sample: Sample) -> None:
        self.sample, self.settings = sample, sample.settings
        self.random = RandomEffects(sample)
        self.rings = int(sample.ring.max(initial=0)) + 1
        self._derivatives = Derivatives(sample)

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
        other_starts: Sequence[tuple[Sequence[Effect], Estimate]] = (),
    ) -> Fitted:
        """Fit the free parameters by maximum likelihood, starting from the current values.

        Args:
            effects: all effects of the sensor.
            free: parameters to fit.
            start: initial random effects. Pose errors in it are reset to 0 if that is more likely. Default: all 0, with
                the initial variance of pose errors.
            steps: maximum number of Gauss–Newton steps; default `settings.descent.steps`.
            roughly: whether to search only as finely as needed to rank candidates.
            dependences: dependences whose coefficients are fitted jointly.
            widened: whether large range residuals are first fitted with an inflated σ (graduated optimisation); not
                needed if the fit starts from a fit to the same ranges.
            simplified: whether derivatives of a model without the last effects may be used for the steps.
            other_starts: further values of the effects and random effects; the fit goes on from the most likely of all
                after a few steps.
        """
        free, dependences = tuple(free), tuple(dependences)
        estimate = self.random.start() if start is None else start
        starts = [self._start(tuple(one), of, dependences) for one, of in ((effects, estimate), *other_starts)]
        is_by_search = [effect.by_search or isinstance(effect, ScanEffect) for effect in starts[0].effects]
        gradual = tuple(parameter for parameter in free if not is_by_search[parameter.effect])
        steps = self.settings.descent.steps if steps is None else steps
        state = self._optimise(starts, gradual, steps, simplified, roughly, widened)
        searched_effects = self._search(state, free, roughly)
        if searched_effects != state.effects:
            state = self._state(searched_effects, state.estimate, dependences=state.dependences)
            state, _ = self._descend(state, (), 0.0, 3)
        return self._finish(state, free)

    def _start(
        self, effects: tuple[Effect, ...], estimate: Estimate, dependences: tuple[Dependence, ...] = ()
    ) -> _State:
        """State with the more likely pose errors: as given, without the mean of some axes, or all 0.

        A new effect may explain what was attributed to pose errors: an error that all scans share, or all errors.
        """
        state = self._state(effects, estimate, dependences=dependences)
        if not self.random.has_poses:
            return state
        poses = self.random.poses(estimate)
        mean = poses.mean(0)
        error = poses.std(0) / np.sqrt(len(poses))
        reduced = state
        for axis in np.flatnonzero(np.abs(mean) > self.settings.random_effects.variance_sigmas * error):
            poses = self.random.poses(reduced.estimate).copy()
            poses[:, axis] -= mean[axis]
            reduced = max(reduced, self._with_poses(reduced, poses), key=self._penalised_loglik)
        return max(reduced, self._with_poses(state, np.zeros_like(poses)), key=self._penalised_loglik)

    def _with_poses(self, state: _State, poses: np.ndarray) -> _State:
        """The state with other pose errors (scans, 6)."""
        u = state.estimate.u.copy()
        u[self.random.rows("poses")] = poses.ravel()
        estimate = replace(state.estimate, u=u)
        return replace(state, estimate=estimate, residuals=self.residuals(state.prediction, estimate))

    def at(self, effects: Sequence[Effect], estimate: Estimate, dependences: Sequence[Dependence] = ()) -> Fitted:
        """Evaluate effects, dependences and random effects at their current values, without fitting."""
        return self._finish(self._state(tuple(effects), estimate, dependences=tuple(dependences)), ())

    def loss(
        self, estimate: Estimate, dependences: tuple[Dependence, ...] = ()
    ) -> Callable[[tuple[Effect, ...]], float]:
        """Return the penalised negative log-likelihood as a function of the effects; all else is fixed."""
        return lambda effects: -self._penalised_loglik(self._state(effects, estimate, dependences=dependences))

    def start_loss(self, effects: tuple[Effect, ...], fitted: Fitted) -> float:
        """Penalised negative log-likelihood of effects at the start of a fit that is initialised by another fit."""
        start = self._start(effects, fitted.estimate, fitted.dependences)
        return -self._penalised_loglik(self._optimise_albedo(start, 0.0))

    def losses(self, effects: tuple[Effect, ...], estimate: Estimate) -> np.ndarray:
        """(n,) contribution of each beam to the negative log-likelihood."""
        return -self.sample.share * self._state(effects, estimate).residuals.loglik

    def adjusted_slopes(self, slopes: Sequence[Column], at: Prediction, estimate: Estimate) -> tuple[Column, ...]:
        """Derivatives of the adjusted prediction (with random effects) from those of the effects' prediction."""
        factors = self.random.prediction_jacobian(at, estimate)
        return tuple(
            replace(column, delta={name: values * factors.get(name, 1.0) for name, values in column.delta.items()})
            for column in slopes
        )

    def is_searched(self, effect: Effect, unknown: Unknown, column: Column) -> bool:
        """Whether a parameter is fitted by line search instead of Gauss–Newton."""
        return is_searched(effect, unknown, column, self.settings.search)

    def _state(
        self,
        effects: tuple[Effect, ...],
        estimate: Estimate,
        blur: float = 0.0,
        dependences: tuple[Dependence, ...] = (),
        before: _State | None = None,
    ) -> _State:
        """State at given values; the prediction of `before` is used if its effects are the same."""
        if before is not None and before.effects == effects:
            bare = before.bare
        else:
            with np.errstate(over="ignore", invalid="ignore"):  # trial values may be unphysical; then they are rejected
                bare = self.sample.predict(effects)
        prediction = apply_changes(self.sample, bare, changes_of(dependences)) if dependences else bare
        return _State(effects, dependences, estimate, bare, prediction, self.residuals(prediction, estimate, blur))

    def _columns(
        self, state: _State, free: tuple[Free, ...], slopes: Sequence[Column] | None = None
    ) -> tuple[Column, ...]:
        """Derivatives of the adjusted prediction with respect to free parameters, then coefficients of dependences."""
        slopes = self._derivatives.of(state.effects, free, state.bare) if slopes is None else slopes
        columns: list[Column] = list(self.adjusted_slopes(slopes, state.prediction, state.estimate))
        if state.dependences:
            factors = self.random.prediction_jacobian(state.prediction, state.estimate)
            of_channel = channel_slopes(
                self.sample,
                state.bare,
                changes_of(state.dependences),
                [dependence.channel for dependence in state.dependences],
            )
            for dependence in state.dependences:
                delta = of_channel.get(dependence.channel, {})
                adjusted: dict[Quantity, np.ndarray] = {
                    name: values * factors.get(name, 1.0) for name, values in delta.items()
                }
                columns.append(Column(adjusted, rings=dependence.size, basis=dependence.basis))
        return tuple(columns)

    def residuals(self, prediction: Prediction, estimate: Estimate, blur: float = 0.0) -> Residuals:
        """Residuals of a prediction after adjustment by the random effects; `blur` [m] as in `residuals_of`."""
        return residuals_of(self.sample, self.random.adjusted(prediction, estimate), blur)

    def residuals_at(self, adjusted: Prediction) -> Residuals:
        """Residuals of a prediction that already includes the random effects."""
        return residuals_of(self.sample, adjusted)

    def _finish(self, state: _State, free: tuple[Free, ...]) -> Fitted:
        columns = self._columns(state, free)
        evidence = Evidence.of(self.sample, state.residuals)
        return Fitted(
            state.effects, free, state.estimate, self._marginal_loglik(state), state.prediction, state.residuals,
            evidence, columns, state.dependences, state.bare,
        )  # fmt: skip

    def _search(self, state: _State, free: tuple[Free, ...], roughly: bool) -> tuple[Effect, ...]:
        """Maximise the likelihood over the parameters it is not differentiable in, such as hard limits."""
        columns = self.adjusted_slopes(
            self._derivatives.of(state.effects, free, state.bare), state.prediction, state.estimate
        )
        searched_parameters = [
            (parameter.effect, parameter.unknown, column)
            for parameter, column in zip(free, columns, strict=True)
            if state.effects[parameter.effect].by_search
            or self.is_searched(state.effects[parameter.effect], parameter.unknown, column)
        ]
        if not searched_parameters:
            return state.effects
        return search_parameters(
            state.effects,
            searched_parameters,
            self.loss(state.estimate, state.dependences),
            self.sample,
            state.residuals,
            roughly=roughly,
        )

    def _optimise(
        self,
        starts: Sequence[_State],
        free: tuple[Free, ...],
        steps: int,
        simplified: bool,
        roughly: bool,
        widened: bool,
    ) -> _State:
        """Run Gauss–Newton from the start that is most likely after a few steps.

        Where large residuals remain after these, a start is fitted again, a few steps with each of several inflated σ.
        """
        before = max(self._penalised_loglik(start) for start in starts) if roughly else None
        few = min(steps, self.settings.descent.few_steps)
        reached: list[tuple[_State, bool]] = []
        for start in starts:
            state, is_converged = self._descend(start, free, 0.0, few, simplified, before)
            reached.append((state, is_converged))
            inflations_m: tuple[float, ...] = ()
            if widened:
                inflations_m = inflations_of(self.sample, self.random.adjusted(state.prediction, state.estimate))
            if inflations_m:
                state = start
                for blur_m in (*inflations_m, 0.0):
                    state, is_converged = self._descend(state, free, blur_m, few, simplified, before)
                reached.append((state, is_converged))
        best, is_converged = reached[0]
        if len(reached) > 1:
            best, is_converged = max(reached, key=lambda one: self._marginal_loglik(one[0]))
        if is_converged or few == steps:
            return best
        return self._descend(best, free, 0.0, steps - few, simplified, before)[0]

    def _descend(
        self,
        state: _State,
        free: tuple[Free, ...],
        blur: float,
        steps: int,
        simplified: bool = False,
        before: float | None = None,
    ) -> tuple[_State, bool]:
        """Run Gauss–Newton steps at one blur [m]; variances of the random effects are updated after each step.

        Args:
            state: at the start.
            free: parameters to fit.
            blur: as in `residuals_of`.
            steps: maximum number of steps.
            simplified: as in `fit`.
            before: penalised log-likelihood before the fit, if candidates are only ranked: then steps end where they
                gain little of what was gained since.

        Returns:
            The last state, and whether the steps have converged.
        """
        roughly = before is not None
        state, reference = replace(state, residuals=self.residuals(state.prediction, state.estimate, blur)), None
        slopes: tuple[Column, ...] = ()
        lists = list_numbers(state.effects, free) * self.sample.of_own_map
        precision = np.zeros(len(lists))
        tried_first, failures, since = 0, 0, None if blur else before

        def objective(candidate: _State) -> float:
            return self._penalised_loglik(candidate) - 0.5 * float(precision @ deviations(candidate.effects, free) ** 2)

        for number in range(steps):
            state = self._optimise_albedo(state, blur)
            value = objective(state)
            evidence = Evidence.of(self.sample, state.residuals, blur).reweighted(
                state.residuals, self.settings.likelihood
            )
            if blur == 0.0 and number in (1, 2, 4):
                initialised = self.random.initialise_variances(state.estimate, state.prediction, evidence)
                state = replace(state, estimate=initialised)
            if reference is None or has_moved(reference, state.effects, free):
                reference, slopes = (
                    state.effects,
                    self._derivatives.of(state.effects, free, state.bare, simplified=simplified),
                )
            columns = self._columns(state, free, slopes)
            model = LinearModel.of(self.random, columns, evidence, state.prediction, state.estimate)
            prior = self._prior(model, state, precision, deviations(state.effects, free))
            state = self._update_spurious_shares(state, blur)
            gain = -np.inf
            is_spread = acts_on_spreads(columns[: len(free)])
            limits = step_limits(state.effects, free, is_spread, model.parameters)
            attempts = [one for one in _ATTEMPTS if one[2] or (is_spread.any() and not roughly)]
            begin = tried_first
            for attempt, (damping, fraction, moves_spreads) in enumerate(attempts[begin:], begin):
                step, change_u = model.step(state.estimate, self._min_identified_share(free), prior, damping, limits)
                step, change_c = step[: len(lists)], step[len(lists) :]
                step = without_common_gain(state.effects, free, step, self.sample.of_own_map)
                step = step if moves_spreads else np.where(is_spread, 0.0, step)
                if not all(np.isfinite(part).all() for part in (step, change_u, change_c)):
                    continue
                moved = replace(state.estimate, u=state.estimate.u + fraction * change_u)
                moved_effects = apply_step(state.effects, free, fraction * step)
                dependences = moved_dependences(state.dependences, fraction * change_c)
                candidate = self._state(moved_effects, moved, blur, dependences, state)
                trial = self._optimise_albedo(candidate, blur, state.estimate)
                reached = objective(trial)
                if reached > value:
                    gain, state, tried_first, failures = reached - value, trial, max(attempt - 1, 0), 0
                    break
            else:
                tried_first, failures = 0, failures + 1
            if lists.any():
                information = model.fixed_information[: len(lists), : len(lists)] + np.diag(precision)
                precision = updated_prior_precisions(lists, deviations(state.effects, free), information)
            after = self.random.update_variances(state.estimate, model.solver)
            is_stationary = bool(
                np.all(np.abs(after.variance - state.estimate.variance) <= 0.1 * after.variance + 1e-12)
            )
            if not np.array_equal(after.u, state.estimate.u):  # those of negligible variance are 0 now
                state = replace(state, residuals=self.residuals(state.prediction, after, blur))
            state = self._with_surface_spread(replace(state, estimate=after), blur)
            since = value if since is None else since
            relative = self.settings.descent.rough_gain * (value - since) if roughly else 0.0
            is_small = gain < max(self.settings.descent.gain, 1e-7 * abs(value), relative)
            if is_small and number >= 2 and (is_stationary or failures >= _MOST_FAILURES):
                if begin == 0:
                    return state, True
                tried_first = 0  # a damped step gains little; a full one may gain more
        return state, False

    def _with_surface_spread(self, state: _State, blur: float) -> _State:
        """Update the factors on the σ of the twin's surfaces."""
        if blur:
            return state
        factors = updated_surface_spread(self.random, state.residuals, state.estimate)
        if factors is state.estimate.surface_spread:
            return state
        estimate = replace(state.estimate, surface_spread=factors)
        return replace(state, estimate=estimate, residuals=self.residuals(state.prediction, estimate, blur))

    def _prior(
        self, model: LinearModel, state: _State, precision: np.ndarray, deviations: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """Precisions of the normal priors of all parameters and the distances from their means, see `LinearModel.step`.

        Coefficients of dependences get a weak prior, so that coefficients that are not identifiable stay at 0.
        """
        if not state.dependences:
            return (precision, deviations) if precision.any() else None
        coefficients = np.concatenate([dependence.coefficients for dependence in state.dependences])
        information = np.maximum(model.own_information_diagonal[len(precision) :], 0.0)
        weak = self.settings.descent.ridge * information + 1e-9
        weak[information <= 0] = 1.0
        return np.append(precision, weak), np.append(deviations, coefficients)

    def _update_spurious_shares(self, state: _State, blur: float) -> _State:
        """Update the shares of spurious returns by one step of expectation maximisation."""
        if not any(dependence.is_one_sided for dependence in state.dependences):
            return state
        residuals = self.residuals(state.prediction, state.estimate, blur)
        per_density = residuals.either / np.exp(residuals.outcome)
        dependences = updated_spurious_shares(self.sample, state.prediction, per_density, state.dependences)
        return self._state(state.effects, state.estimate, blur, dependences, state)

    def _optimise_albedo(self, state: _State, blur: float, other: Estimate | None = None) -> _State:
        """Update the albedos of the surfaces of a map made from the scans; `other` as in `updated_map_albedo`."""
        matched = self.sample.share * state.residuals.matched
        estimate = updated_map_albedo(self.random, state.prediction, matched, state.estimate, other)
        if estimate is state.estimate:
            return state
        return replace(state, estimate=estimate, residuals=self.residuals(state.prediction, estimate, blur))

    def _min_identified_share(self, free: Sequence[Free]) -> float:
        """`min_share` of `LinearModel.step`: above 0 only for per-laser lists on a map made from the scans."""
        lists = any(parameter.unknown.rings > 1 for parameter in free)
        return self.settings.descent.min_identified_share if lists and self.sample.of_own_map else 0.0

    def _penalised_loglik(self, state: _State) -> float:
        penalty = state.estimate.u**2 @ np.where(
            self.random.active(state.estimate), self.random.precision(state.estimate), 0
        )
        return float(self.sample.share @ state.residuals.loglik) - 0.5 * float(penalty)

    def _marginal_loglik(self, state: _State) -> float:
        evidence = Evidence.of(self.sample, state.residuals)
        model = LinearModel.of(self.random, (), evidence, state.prediction, state.estimate)
        volume = 0.5 * model.shrinkage() + self.random.log_brightness(state.estimate)
        return self._penalised_loglik(state) - volume

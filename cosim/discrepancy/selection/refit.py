"""Exact refits: a candidate fitted together with everything that was selected before, random effects included."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.analysis import FittedFrames
from cosim.discrepancy.candidates import with_values
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.dictionary.covariates import SampleCovariate, constant, refined, sample_covariates
from cosim.discrepancy.dictionary.groups import Group, binned_group
from cosim.discrepancy.dictionary.linearisation import Linearisation, linearise
from cosim.discrepancy.dictionary.objects import object_groups
from cosim.discrepancy.dictionary.periodic import line_group, wave_groups
from cosim.discrepancy.inference.dependence import Dependence
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.parameters import all_free
from cosim.discrepancy.inference.random_effects import Estimate
from sensors.effects.base import Effect

_REFIT_STEPS = 10
_STRENGTHS = (1.0, 0.3, 3.0, 0.03)  # times the coefficients of one Gauss–Newton step, from which a fit may start


@dataclass(frozen=True, eq=False)
class Term:
    """A selected group.

    Attributes:
        group: the hypothesis, in the bins in which it is fitted.
        p_value: family-wise, when it was selected.
        gain: log-likelihood on clusters that took no part in its fit, when it was selected.
        exact_gain: log-likelihood that the model loses without it; that of `gain` for shared errors.
        penalty: expected gain of as many parameters by chance.
        alternatives: names of groups that could replace it.
    """

    group: Group
    p_value: float
    gain: float
    exact_gain: float
    penalty: float = 1.0
    alternatives: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A fitted model on the frames of the analysis.

    Attributes:
        frames: traced as the effects bend the beams.
        fitter, fitted: sample and fit.
        free: indices of the effects whose parameters are fitted.
        terms: selected so far; the dependences of `fitted` are those of the dependence terms, in order.
    """

    frames: tuple[TracedFrame, ...]
    fitter: Fitter
    fitted: Fitted
    free: tuple[int, ...] = ()
    terms: tuple[Term, ...] = ()

    @property
    def loglik(self) -> float:
        """Marginal log-likelihood of the fit."""
        return self.fitted.loglik

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of the shared errors in the model, selected ones and those of the given sensor."""
        return tuple(
            f"{effect.channel} by {getattr(effect, 'shared_by')}"  # noqa: B009
            for effect in self.fitted.effects
            if effect.channel.startswith("shared_")
        )

    def index_of(self, term: Term) -> int | None:
        """Index of a term's effect; None where it is no effect of the model."""
        names = [effect.name for effect in self.fitted.effects]
        name = term.group.effect_name
        return names.index(name) if name in names else None


def refit_with(
    model: FittedModel,
    linearisation: Linearisation,
    group: Group,
    start: np.ndarray,
    *,
    fine: bool,
    steps: int,
    absorbed: np.ndarray | None = None,
) -> tuple[FittedModel, Group]:
    """Fit a model with one group more, without its entry among the terms; and the group in the bins that were fitted.

    Args:
        model: so far.
        linearisation: about it.
        group: the candidate.
        start: (k,) initial coefficients, `Entry.start`.
        fine: whether a dependence is fitted in its finest bins.
        steps: Gauss–Newton steps at most.
        absorbed: (m, k) changes of the random effects that change beams like an effect's columns, `Entry.absorbed`.
    """
    fitter, fitted = model.fitter, model.fitted
    if group.is_effect:
        ((effects, estimate), *others), index = _starts(model, group, start, absorbed)
        free = model.free if index in model.free else (*model.free, index)
        after = fitter.fit(
            effects, all_free(effects, free, fitter.rings), estimate, steps=steps, roughly=True,
            dependences=fitted.dependences, widened=group.family == "range", simplified=not fine, other_starts=others,
        )  # fmt: skip
        return replace(model, fitted=after, free=free), group
    if fine:
        group = finest(linearisation, group)
        start = np.zeros(group.size)
    assert group.basis is not None  # shared errors are not refitted
    dependence = Dependence(group.name, group.channel, group.basis, start)
    widened = group.family == "range"
    after = fit_again(model, fitted.effects, model.free, (*fitted.dependences, dependence), steps, widened=widened)
    return replace(model, fitted=after), group


def refit_without(model: FittedModel, term: Term, initial: Sequence[Effect], steps: int) -> FittedModel:
    """Fit a model without one of its terms; an effect that the sensor had gets its initial parameters.

    Args:
        model: with the term.
        term: that is left out.
        initial: effects of the sensor as it was given.
        steps: Gauss–Newton steps at most.
    """
    effects, free, dependences = model.fitted.effects, model.free, model.fitted.dependences
    terms = tuple(other for other in model.terms if other is not term)
    index = model.index_of(term)
    if index is not None and index < len(initial):
        effects = (*effects[:index], initial[index], *effects[index + 1 :])
        free = tuple(other for other in free if other != index)
    elif index is not None:
        effects = (*effects[:index], *effects[index + 1 :])
        free = tuple(other - (other > index) for other in free if other != index)
    else:
        dependences = tuple(one for one in dependences if one.basis is not term.group.basis)
    return replace(model, fitted=fit_again(model, effects, free, dependences, steps), free=free, terms=terms)


def fit_again(
    model: FittedModel,
    effects: tuple[Effect, ...],
    free: Sequence[int],
    dependences: Sequence[Dependence],
    steps: int,
    *,
    widened: bool = False,
) -> Fitted:
    """Fit effects and dependences from where the random effects of a model are; `widened` as in `Fitter.fit`."""
    fitter = model.fitter
    return fitter.fit(
        effects, all_free(effects, free, fitter.rings), model.fitted.estimate, steps=steps, roughly=True,
        dependences=dependences, widened=widened,
    )  # fmt: skip


def rebuild(model: FittedModel, on: FittedFrames) -> FittedModel:
    """The model on frames that were traced again: its dependences get bases of the new sample and are fitted.

    Args:
        model: with terms.
        on: the frames, effects fitted without the dependences.
    """
    bare = replace(model, frames=on.frames, fitter=on.fitter, fitted=on.fitted, terms=())
    linearisation = linearise(on.fitter, on.fitted, on.frames)
    sample = on.fitter.sample
    covariates = {one.name: one for one in sample_covariates(sample, on.fitted.prediction, on.frames)}
    terms, dependences = list[Term](), list[Dependence]()
    for term in model.terms:
        if term.group.basis is not None:
            group = rebuilt(linearisation, term.group, covariates)
            if group is None or group.basis is None:
                continue
            term = replace(term, group=group)
            dependences.append(Dependence(group.name, group.channel, group.basis, np.zeros(group.size)))
        terms.append(term)
    if dependences:
        bare = replace(bare, fitted=fit_again(bare, on.fitted.effects, model.free, dependences, _REFIT_STEPS))
    return replace(bare, terms=tuple(terms))


def rebuilt(linearisation: Linearisation, group: Group, covariates: Mapping[str, SampleCovariate]) -> Group | None:
    """A dependence on another sample of the same drive; None where the sample has no such covariate."""
    sample = linearisation.sample
    fewest = max(sample.settings.dictionary.fewest_in_cell // 2, 1)
    if group.frequency_hz:
        return line_group(linearisation, group.channel, group.frequency_hz)
    if group.covariates[-1] in ("object_size", "object_place"):
        return next((one for one in object_groups(linearisation) if one.name == group.name), None)
    if not group.is_clustered_by_scan:
        return next((one for one in wave_groups(linearisation, group.channel) if one.name == group.name), None)
    if group.covariates == ("constant",):
        return binned_group(linearisation, group.channel, constant(sample), 1)
    if any(name not in covariates for name in group.covariates):
        return None
    parts = [covariates[name] for name in group.covariates]
    if len(parts) == 1:
        return binned_group(linearisation, group.channel, refined(parts[0], sample), fewest)
    return binned_group(linearisation, group.channel, parts[0].crossed(parts[1]), fewest)


def finest(linearisation: Linearisation, group: Group) -> Group:
    """Return the dependence with the largest number of bins that a fit may have."""
    if group.covariate is None:
        return group
    sample = linearisation.sample
    covariate = refined(group.covariate, sample)
    fewest = max(sample.settings.dictionary.fewest_in_cell // 2, 1)
    found = binned_group(linearisation, group.channel, covariate, fewest)
    return group if found is None or found.size < group.size else found


def _starts(
    model: FittedModel, group: Group, coefficients: np.ndarray, absorbed: np.ndarray | None
) -> tuple[list[tuple[tuple[Effect, ...], Estimate]], int]:
    """Effects with the candidate and random effects from which fits may start, and the index of the candidate.

    The candidate has the most likely of a few strengths. If random effects have absorbed it, a second fit starts where
    it has its full strength and they have lost what they absorbed.
    """
    tangent, fitter, fitted = group.tangent, model.fitter, model.fitted
    assert tangent is not None  # of an effect
    effects, index, estimate = fitted.effects, tangent.index, fitted.estimate
    names = [effect.name for effect in effects]
    if index is None and tangent.effect.name in names:
        index = names.index(tangent.effect.name)
    position = len(effects) if index is None else index
    weak = tangent.effect
    if not tangent.amplitude:
        return [((*effects[:position], weak, *effects[position + 1 :]), estimate)], position
    off = np.asarray(getattr(weak, tangent.amplitude), float) - tangent.step
    size = coefficients * tangent.step if group.direct is not None else coefficients
    size = size if off.ndim else float(size[0])
    trials = [with_values(weak, {tangent.amplitude: off + strength * size}) for strength in _STRENGTHS]
    models = [(*effects[:position], trial, *effects[position + 1 :]) for trial in trials]
    starts = [(min(models, key=lambda effects: fitter.start_loss(effects, fitted)), estimate)]
    if absorbed is not None and absorbed.size:
        starts.append((models[0], replace(estimate, u=estimate.u - absorbed @ coefficients)))
    return starts, position

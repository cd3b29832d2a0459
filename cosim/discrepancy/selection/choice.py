"""Choice of the next term: a shortlist of candidates, their exact refits, the best of these and its alternatives."""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.dictionary.groups import FAMILIES, Group
from cosim.discrepancy.dictionary.linearisation import linearise
from cosim.discrepancy.dictionary.periodic import line_group
from cosim.discrepancy.dictionary.shared_errors import shared_errors
from cosim.discrepancy.inference.dependence import ANGLES, SPREADS
from cosim.discrepancy.selection.confirm import p_of_gain
from cosim.discrepancy.selection.curves import curve_of
from cosim.discrepancy.selection.evidence import SelectionEvidence
from cosim.discrepancy.selection.gain import is_rival
from cosim.discrepancy.selection.refit import FittedModel, Term, fit_again, refit_with
from cosim.discrepancy.selection.table import GroupTest
from cosim.discrepancy.settings import Settings
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import effect_of

_LOG = logging.getLogger(__name__)
STEPS = 10
"""Maximum number of Gauss–Newton steps of a refit to convergence."""
_ROUGH_STEPS = 4  # of a refit that compares candidates
_SAME_SIZE = 0.02  # relative change of a shared error's standard deviation at which its estimate has converged
_LEAST_Z = 3.0  # standardised score of a hypothesis that turns beams above which it is refitted


def needed_gain(group: Group, model: FittedModel, settings: Settings) -> float:
    """Log-likelihood that a term must gain: the first one little, a follower more than what fits are exact to.

    Bins approximate an unknown function, so that a share of what a dependence gains is left to others of its family;
    an effect of the catalogue has its exact equation. Gains of shared errors are those of a linear model.

    Args:
        group: the candidate.
        model: with its terms.
        settings: numeric choices.
    """
    by = settings.selection
    if not model.terms:
        return by.least_gain
    fitted = [term for term in model.terms if not term.group.is_shared]
    family = [term for term in fitted if term.group.family == group.family]
    if group.is_shared:
        return max(by.least_follower, by.shared_share * max((term.exact_gain for term in family), default=0.0))
    in_bins = [term.exact_gain for term in fitted if not term.group.is_effect]
    of_family = [term.exact_gain for term in family if not term.group.is_effect]
    return max(
        by.least_follower, by.follower_share * max(of_family, default=0.0), by.inexact * max(in_bins, default=0.0)
    )


@dataclass(frozen=True)
class Rejected:
    """Candidates that are not added to a model.

    Attributes:
        names: of their groups.
        is_chance: whether their exact refits gain no more than chance; otherwise their gain is not significant next to
            this model, but may be next to others.
    """

    names: frozenset[str]
    is_chance: bool


@dataclass(frozen=True, eq=False)
class _Trial:
    """A candidate and its exact refit.

    Attributes:
        result: of the candidate.
        gain: marginal log-likelihood that the refit gains.
        model: refitted; None if the refit was made earlier.
    """

    result: GroupTest
    gain: float
    model: FittedModel | None

    @property
    def penalty(self) -> float:
        """Twice the gain expected by chance for this number of parameters: the trace of Takeuchi's criterion (1976)."""
        return _penalty(self.result.group, self.result)

    @property
    def net_gain(self) -> float:
        """Gain less penalty."""
        return self.gain - self.penalty


def choose(
    model: FittedModel,
    evidence: SelectionEvidence,
    candidates: Sequence[GroupTest],
    rejected: Collection[str],
    settings: Settings,
) -> tuple[FittedModel, GroupTest] | Rejected:
    """The model with the best candidate, and which it is; or candidates that are not added."""
    best = _first(candidates)
    if best.group.is_shared:
        return _with_shared(model, evidence, best, settings), best
    same_order = [
        result for result in candidates if result.group.order == best.group.order and not result.group.is_shared
    ]
    results = [result for result in evidence.results if result.group.name not in rejected]
    shortlist: list[GroupTest] = []
    for family in FAMILIES[: FAMILIES.index(best.group.family) + 1]:  # an error also shows in later families
        of_family = [result for result in same_order if result.group.family == family]
        shortlist += _shortlist(sorted(of_family, key=lambda result: result is not best), settings)
    kinds = {_kind(result.group) for result in shortlist}
    shortlist += [result for result in _leading_effects(best, same_order) if _kind(result.group) not in kinds]
    shortlist += _turned(best, results, shortlist)
    trials = [_tried(model, evidence, result, settings) for result in shortlist]
    _LOG.debug("tried %s", [(one.result.group.name, round(one.result.gain, 1), round(one.gain, 1)) for one in trials])
    trial = _simplest(trials, settings)
    needed = {one: needed_gain(one.result.group, model, settings) for one in trials}
    if trial.net_gain < needed[trial]:
        return Rejected(frozenset(one.result.group.name for one in trials if one.net_gain < needed[one]), True)
    result = trial.result
    after, group = trial.model or _refitted(model, evidence, result, settings), result.group
    shared = [one for one in candidates if one.group.is_shared and one.group.family == group.family]
    if group.channel in SPREADS and shared:  # an error that beams share is noise of each, too; noise is not shared
        return _with_shared(model, evidence, shared[0], settings), shared[0]
    if not group.is_effect:
        after, group = _refined(model, evidence, trial)
    if after.loglik - model.loglik - trial.penalty < needed_gain(group, model, settings):
        return Rejected(frozenset({result.group.name}), True)
    if group.frequency_hz:
        after, group = _best_alias(model, evidence, after, group)
    p_value = _p_value(model, evidence, after, group, result, settings)
    level = settings.selection.level
    if p_value > level:
        # Other trials of the family gain as much in the same clusters. Kept are those with significant scores and those
        # that are tested on random effects.
        others = [one.result for one in trials if one.result.group.family == group.family]
        names = {one.group.name for one in others if one.p_value > level and not one.entry.is_of_random}
        return Rejected(frozenset({result.group.name, *names}), False)
    after, group = _by_laser(model, evidence, after, group)
    gain = after.loglik - model.loglik
    alternatives = tuple(name for name in _rivals(trial, trials) if name != group.hypothesis)
    # An effect may have replaced the dependence.
    term = Term(group, p_value, result.gain, gain, _penalty(group, result), alternatives)
    return replace(after, terms=(*model.terms, term)), result


def _tried(model: FittedModel, evidence: SelectionEvidence, result: GroupTest, settings: Settings) -> _Trial:
    """The candidate with its exact gain, which is computed once about a model."""
    name = result.group.name
    if name in evidence.exact_gains:
        return _Trial(result, evidence.exact_gains[name], None)
    after = _refitted(model, evidence, result, settings)
    evidence.exact_gains[name] = after.loglik - model.loglik
    return _Trial(result, evidence.exact_gains[name], after)


def _refitted(model: FittedModel, evidence: SelectionEvidence, result: GroupTest, settings: Settings) -> FittedModel:
    """The model with a candidate.

    Shape parameters of effects, and what random effects have absorbed, start far from their values.
    """
    is_far = result.group.is_effect or result.entry.is_of_random
    after, _ = refit_with(
        model, evidence.linearisation, result.group, result.entry.start, fine=False,
        steps=settings.descent.steps if is_far else _ROUGH_STEPS, absorbed=result.entry.absorbed,
    )  # fmt: skip
    return after


def _p_value(
    model: FittedModel,
    evidence: SelectionEvidence,
    after: FittedModel,
    group: Group,
    result: GroupTest,
    settings: Settings,
) -> float:
    """Family-wise p-value of a refitted candidate: that of its scores, or of its exact gain if scores do not decide."""
    only_random, penalty = result.entry.is_of_random, _penalty(group, result)
    if result.p_value <= settings.selection.level and not only_random:
        return result.p_value
    p_of_one = p_of_gain(model, after, group, penalty, settings.selection, only_random=only_random)
    if only_random:
        p_of_one = 2 * min(p_of_one, result.entry.p_of_predictions())
    return min(p_of_one * evidence.tested_like(result.entry), 1.0)


def _with_shared(model: FittedModel, evidence: SelectionEvidence, result: GroupTest, settings: Settings) -> FittedModel:
    """The model with a shared error, whose variance is part of the noise of each beam from now on.

    Scores of residuals that are large for the model's noise are bounded: the variance is estimated again with it.
    """
    term = Term(result.group, result.p_value, result.gain, result.gain)
    after, linearisation = model, evidence.linearisation
    effects, dependences, size = model.fitted.effects, model.fitted.dependences, 0.0
    for _ in range(settings.descent.steps):
        curve = curve_of(linearisation, term, settings.selection.sectors)
        assert curve is not None  # shared errors have one
        effects = (*model.fitted.effects, effect_of(UnknownEffect.of(curve)))
        size, before = float(curve.y[0]), size
        if abs(size - before) <= _SAME_SIZE * size:
            break
        after = replace(model, fitted=fit_again(after, effects, model.free, dependences, 1))
        linearisation = linearise(after.fitter, after.fitted, after.frames)
        group = next(
            (one.group for one in shared_errors(linearisation) if one.group.name == term.group.name), term.group
        )
        term = replace(term, group=group)
    fitted = fit_again(after, effects, model.free, dependences, settings.descent.steps, widened=True)
    return replace(model, fitted=fitted, terms=(*model.terms, term))


def _refined(model: FittedModel, evidence: SelectionEvidence, trial: _Trial) -> tuple[FittedModel, Group]:
    """A dependence fitted to convergence, in its finest bins where these are more likely than those of the trial."""
    result = trial.result
    for fine in (True, False):
        after, group = refit_with(
            model, evidence.linearisation, result.group, result.entry.start, fine=fine, steps=STEPS
        )
        if after.loglik - model.loglik >= trial.gain or group is result.group:
            break
    return after, group


def _by_laser(
    model: FittedModel, evidence: SelectionEvidence, best: FittedModel, group: Group
) -> tuple[FittedModel, Group]:
    """An effect with one value per laser instead of a dependence on the laser, if it explains nearly as much.

    It is the same function, but its linear gain may be small: on a map of own scans, few differences are determined.
    """
    if group.covariates != ("ring",):
        return best, group
    linearisation = evidence.linearisation
    needed = 1 - linearisation.sample.settings.selection.named
    for result in evidence.results:
        other = result.group
        if other.is_effect and other.size == linearisation.fitter.rings and other.family == group.family:
            after, _ = refit_with(
                model, linearisation, other, result.entry.start, fine=False, steps=STEPS,
                absorbed=result.entry.absorbed,
            )  # fmt: skip
            if after.loglik - model.loglik > needed * (best.loglik - model.loglik):
                best, group = after, other
    return best, group


def _best_alias(
    model: FittedModel, evidence: SelectionEvidence, best: FittedModel, group: Group
) -> tuple[FittedModel, Group]:
    """Choose the most likely of the frequencies that the interval between scans does not separate."""
    linearisation = evidence.linearisation
    time_s = np.sort(linearisation.sample.scan_values["time_s"])
    apart_hz = 1 / max(float(np.median(np.diff(time_s))), 1e-3)
    for side in (-1, 1):
        while group.frequency_hz + side * apart_hz > 0:
            other = line_group(linearisation, group.channel, group.frequency_hz + side * apart_hz)
            after, other = refit_with(model, linearisation, other, np.zeros(2), fine=True, steps=STEPS)
            if after.loglik <= best.loglik:
                break
            best, group = after, other
    return best, group


def _first(candidates: Sequence[GroupTest]) -> GroupTest:
    """The candidate of the largest gain of the lowest order.

    A mean goes before a spread of the same family, because a wrong mean looks like spread.
    """
    lowest = min(result.group.order for result in candidates)
    same_order = [result for result in candidates if result.group.order == lowest]
    best = same_order[0]
    if best.group.channel not in SPREADS:
        return best
    means = [
        result
        for result in same_order
        if result.group.family == best.group.family and result.group.channel not in SPREADS
    ]
    return next((result for result in means if result.gain > 0.2 * best.gain), best)


def _shortlist(candidates: Sequence[GroupTest], settings: Settings) -> list[GroupTest]:
    """Groups of one family that may be the same thing as the first one: with much of its gain, each kind once."""
    if not candidates:
        return []
    by, best = settings.selection, candidates[0]  # the best mean, where a spread gains more
    picked = [result for result in candidates if result.gain >= by.rival_share * best.gain]
    named = [result for result in candidates if _is_simple_effect(result.group) and result.gain >= 0.3 * best.gain]
    shortlist = _each_kind_once(picked)[: by.rivals + 1]
    return _each_kind_once([*shortlist, *_each_kind_once(named)[:3]])


def _leading_effects(best: GroupTest, candidates: Sequence[GroupTest]) -> list[GroupTest]:
    """The leading effect of the family of the best candidate, and of each later one.

    Linear gains only roughly predict exact ones: those of dependences of rare returns may be ten times larger. The
    refit of a candidate uses all data: darker returns are also lost more often, so that a change of intensities can fit
    losses that an effect of the returns explains better.
    """
    leading = {}
    for result in sorted(candidates, key=lambda result: -result.gain):
        if result.group.is_effect:
            leading.setdefault(result.group.family, result)
    return [leading[family] for family in FAMILIES[FAMILIES.index(best.group.family) :] if family in leading]


def _turned(best: GroupTest, results: Sequence[GroupTest], shortlist: Sequence[GroupTest]) -> list[GroupTest]:
    """Hypotheses that turn beams, whatever their linear gain: they are far from linear.

    Beams that are turned far from where they were predicted look like returns of no surface, or like more noise.
    """
    if best.group.order or (best.group.family == "intensity" and best.group.channel not in SPREADS):
        return []
    turning = [
        other
        for other in _each_kind_once(results)
        if other.group.turns_beams
        and (other.group.channel in ANGLES or _is_simple_effect(other.group))
        and other.group.order == 0
        and other.entry.z > _LEAST_Z
    ]
    first: dict[str, list[GroupTest]] = {}
    for result in turning:
        first.setdefault("" if result.group.is_effect else result.group.channel, []).append(result)
    seen = {_kind(result.group) for result in shortlist}
    return [result for those in first.values() for result in those[:3] if _kind(result.group) not in seen]


def _is_simple_effect(group: Group) -> bool:
    """Whether it is an effect of at most three parameters, such as a rotation; a calibration by laser is not."""
    return group.is_effect and group.size <= 3


def _each_kind_once(results: Sequence[GroupTest]) -> list[GroupTest]:
    """The first result of each kind."""
    first: dict[tuple, GroupTest] = {}
    for result in results:
        first.setdefault(_kind(result.group), result)
    return list(first.values())


def _kind(group: Group) -> tuple:
    """Key that is equal for groups of the same hypothesis with other bins or another setting."""
    return (
        group.channel,
        group.effect_name,
        group.covariates,
        round(group.frequency_hz, 2),
        group.name if not group.covariates and not group.is_effect else "",
    )


def _simplest(trials: Sequence[_Trial], settings: Settings) -> _Trial:
    """The candidate that is worth most; a named or simpler one that is worth nearly as much."""
    by = settings.selection
    best = max(trials, key=lambda trial: trial.net_gain)
    named = [
        trial
        for trial in trials
        if trial.result.group.is_effect
        and trial.result.group.size <= max(best.result.group.size, 2)
        and trial.gain > (1 - by.named) * best.gain
        and trial.net_gain > 0
    ]
    if named:
        return max(named, key=lambda trial: trial.net_gain)
    near = [
        trial
        for trial in trials
        if trial.net_gain > best.net_gain - max(by.simpler * best.gain, 8.0) and trial.net_gain > 0
    ]
    return min(near or [best], key=lambda trial: _complexity(trial.result.group))


def _penalty(group: Group, result: GroupTest) -> float:
    """Penalty of a group, `_Trial.penalty`, with the dispersion of the scores of its test."""
    return group.parameters * max(result.entry.cell.dispersion, 1.0)


def _complexity(group: Group) -> int:
    return group.parameters + 10 * len(group.covariates) - 5 * group.is_effect


def _rivals(chosen: _Trial, trials: Sequence[_Trial]) -> tuple[str, ...]:
    """Names of the hypotheses that could replace the chosen one: effects first, each once.

    A hypothesis of which the chosen one is a special case is no alternative: their penalised gains have decided.
    """
    folds, group = chosen.result.fold_gains, chosen.result.group
    rivals = [
        other.result.group
        for other in trials
        if other is not chosen
        and is_rival(chosen.gain, other.gain, folds, other.result.fold_gains)
        and not group.is_special_case_of(other.result.group)
    ]
    own = group.hypothesis
    names = [group.hypothesis for group in sorted(rivals, key=lambda group: not group.is_effect)]
    return tuple(dict.fromkeys(name for name in names if name != own))

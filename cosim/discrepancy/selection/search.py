"""Stepwise selection: shortlist by cross-fitted gains, choose by exact refits, delete what became superfluous."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.dictionary.build import Dictionary, build_dictionary
from cosim.discrepancy.dictionary.groups import FAMILIES, Group
from cosim.discrepancy.dictionary.linearisation import Linearisation, linearise
from cosim.discrepancy.dictionary.periodic import line_group
from cosim.discrepancy.dictionary.shared_errors import shared_errors
from cosim.discrepancy.inference.dependence import ANGLES, SPREADS
from cosim.discrepancy.inference.projection import TRACK
from cosim.discrepancy.selection.confirm import p_about_fit
from cosim.discrepancy.selection.first_pass import first_pass
from cosim.discrepancy.selection.gain import is_rival
from cosim.discrepancy.selection.refit import FittedModel, Term, refit_with, refit_without
from cosim.discrepancy.selection.table import GroupTest, evaluate, score_groups, score_shared
from cosim.discrepancy.settings import Settings
from sensors.effects.base import Effect

_LOG = logging.getLogger(__name__)
_ROUGH_STEPS, _STEPS = 4, 10
_SAME_HZ = 1.0
_LEAST_Z = 3.0  # standardised score of a hypothesis that turns beams above which it is refitted


@dataclass(frozen=True, eq=False)
class SelectionEvidence:
    """Evidence in the scores about a model.

    Attributes:
        linearisation: of the model.
        dictionary: all hypotheses.
        results: of those that the first pass kept, the largest gain first.
        rejected: names of groups whose exact refits gain no more than chance.
    """

    linearisation: Linearisation
    dictionary: Dictionary
    results: list[GroupTest]
    rejected: frozenset[str] = frozenset()

    def significant(self, settings: Settings) -> list[GroupTest]:
        """Results at or below the level that gain something on clusters that took no part."""
        least = settings.selection.least_gain
        level = settings.selection.level
        return [
            result
            for result in self.results
            if result.p_value <= level and result.gain >= least and result.group.name not in self.rejected
        ]

    def candidates(self, settings: Settings) -> list[GroupTest]:
        """Significant results, and those that gain so much that their own fit has to decide."""
        by, significant = settings.selection, self.significant(settings)
        uncertain = [
            result
            for result in self.results
            if result.gain >= by.confirm_gain and not result.group.is_shared and not result.group.is_count
        ]
        names = {result.group.name for result in significant}
        both = [*significant, *(result for result in uncertain if result.group.name not in names)]
        return sorted(both, key=lambda result: -result.gain)


def gather_evidence(model: FittedModel, effects: Sequence[Group], settings: Settings, seed: int) -> SelectionEvidence:
    """Linearise about a model and test every hypothesis.

    Args:
        model: fitted.
        effects: tangents of catalogue effects.
        settings: numeric choices.
        seed: of signs and folds.
    """
    rng, by = np.random.default_rng([seed, len(model.terms)]), settings.selection
    linearisation = linearise(model.fitter, model.fitted, model.frames)
    dictionary = build_dictionary(linearisation, effects, settings, rng)
    projector = linearisation.projector(by.sectors)
    kept = first_pass(linearisation, dictionary, projector, settings)
    entries = score_groups(linearisation, kept, projector, by)
    shared = shared_errors(linearisation, projector.clusters[TRACK])
    entries += score_shared(linearisation, shared, model.shared, projector)
    tested = dictionary.tested + len(shared)
    results = evaluate(entries, by, rng, max(tested / max(len(entries), 1), 1.0))
    return SelectionEvidence(linearisation, dictionary, results)


def select_terms(
    model: FittedModel,
    tangents: Callable[[Linearisation, FittedModel], Sequence[Group]],
    initial: Sequence[Effect],
    settings: Settings,
    seed: int,
    retrace: Callable[[FittedModel], FittedModel],
    on_progress: Callable[[str], None],
    on_first: Callable[[SelectionEvidence], None] = lambda _: None,
) -> tuple[FittedModel, SelectionEvidence]:
    """Add the best term, refit, delete superfluous ones, and repeat until no significant term is left.

    Args:
        model: fitted, without terms.
        tangents: of the catalogue's effects about a model.
        initial: effects of the sensor as it was given.
        settings: numeric choices.
        seed: of signs and folds.
        retrace: traces the frames again where the effects bend beams too far from where they were traced.
        on_progress: called with a message for each step.
        on_first: called with the evidence about the initial model.

    Returns:
        The model with its terms, and the evidence that is left.
    """
    by, rejected = settings.selection, set[str]()
    effects = tangents(linearise(model.fitter, model.fitted, model.frames), model)
    evidence = gather_evidence(model, effects, settings, seed)
    on_first(evidence)
    while len(model.terms) < by.steps:
        candidates = [
            result
            for result in evidence.candidates(settings)
            if result.group.name not in rejected
            and not is_explained(result.group, model)
            and result.gain >= needed_gain(result.group, model, settings)
        ]
        if not candidates:
            break
        chosen = _choose(model, evidence, candidates, rejected, settings)
        if isinstance(chosen, frozenset):
            on_progress(f"rejected {', '.join(sorted(chosen))}: fits gain no more than chance")
            rejected |= _same_effects(chosen, candidates)
            continue
        before, (model, result) = model, chosen
        on_progress(f"added {result.group.name}: gain {result.gain:.1f}, p {result.p_value:.4f}")
        model = drop_superfluous(model, initial, settings, rejected, on_progress)
        if not result.group.is_shared:
            model = retrace(model)
        if model.fitted.effects != before.fitted.effects:
            effects = tangents(linearise(model.fitter, model.fitted, model.frames), model)
            model = replace_dependences(model, effects, initial, settings, seed, rejected, on_progress)
        evidence = gather_evidence(model, effects, settings, seed)
    return model, replace(evidence, rejected=frozenset(rejected))


def replace_dependences(
    model: FittedModel,
    effects: Sequence[Group],
    initial: Sequence[Effect],
    settings: Settings,
    seed: int,
    rejected: Collection[str],
    on_progress: Callable[[str], None] = lambda _: None,
) -> FittedModel:
    """Replace dependences of the latest term's family by what fits as well now (sequential replacement).

    Bins that were selected first follow the sum of several effects; once one of these is among the terms, another
    effect may explain the rest (Miller, Subset Selection in Regression, 2002, § 3.6).

    Args:
        model: fitted, with its terms.
        effects: tangents of the catalogue's effects about it.
        initial: effects of the sensor as it was given.
        settings: numeric choices.
        seed: of signs and folds.
        rejected: names of groups that are not tried again.
        on_progress: called with a message for each replacement.
    """
    family = model.terms[-1].group.family
    for term in model.terms[:-1]:
        group = term.group
        if group.is_effect or group.is_shared or group.family != family or group.channel in SPREADS:
            continue
        less = refit_without(model, term, initial, _STEPS)
        evidence = gather_evidence(less, effects, settings, seed)
        candidates = [
            result
            for result in evidence.candidates(settings)
            if result.group.name not in rejected
            and result.group.family == family
            and result.group.order == 0
            and not is_explained(result.group, less)
        ]
        chosen = _choose(less, evidence, candidates, rejected, settings) if candidates else frozenset[str]()
        if not isinstance(chosen, frozenset) and chosen[1].group.hypothesis != group.hypothesis:
            model = chosen[0]
            on_progress(f"replaced {group.name} by {chosen[1].group.name}")
    return model


def drop_superfluous(
    model: FittedModel,
    initial: Sequence[Effect],
    settings: Settings,
    rejected: set[str],
    on_progress: Callable[[str], None] = lambda _: None,
) -> FittedModel:
    """The model without the terms that the latest one has made superfluous; their names go to `rejected`."""
    for term in [term for term in model.terms[:-1] if not term.group.is_shared]:
        if term.group.channel in SPREADS:
            continue
        less = refit_without(model, term, initial, _STEPS)
        loss = model.loglik - less.loglik
        _LOG.debug("without %s: %.1f less likely", term.group.name, loss)
        if loss < settings.selection.least_follower + term.penalty:
            on_progress(f"removed {term.group.name}: {loss:.1f} less likely without it")
            rejected.add(term.group.name)
            model = less
        else:
            updated = replace(term, exact_gain=loss)
            model = replace(model, terms=tuple(updated if other is term else other for other in model.terms))
    return model


def _same_effects(names: frozenset[str], candidates: Sequence[GroupTest]) -> frozenset[str]:
    """These names and those of all other settings of the same effects."""
    effects = {result.group.effect_name for result in candidates if result.group.name in names} - {""}
    return names | {result.group.name for result in candidates if result.group.effect_name in effects}


def is_explained(group: Group, model: FittedModel) -> bool:
    """Whether the same dependence was selected already, in these or other bins: fitting it again changes nothing.

    A selected shared error also explains what neighbours measured of the same channel.
    """
    if group.is_effect:
        return False
    if group.is_of_neighbour and any(term.group.channel == f"shared_{group.channel}" for term in model.terms):
        return True
    selected = [term.group for term in model.terms if term.group.channel == group.channel and not term.group.is_effect]
    if group.frequency_hz:
        return any(abs(other.frequency_hz - group.frequency_hz) < _SAME_HZ for other in selected)
    if group.covariate is None:
        return any(other.name == group.name for other in selected)
    return any(other.covariate is not None and set(other.covariates) == set(group.covariates) for other in selected)


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


@dataclass(frozen=True, eq=False)
class _Trial:
    """A candidate and its exact refit.

    Attributes:
        result: of the candidate.
        gain: marginal log-likelihood that the refit gains.
        model: refitted.
    """

    result: GroupTest
    gain: float
    model: FittedModel

    @property
    def penalty(self) -> float:
        """Twice the gain expected by chance for this number of parameters: the trace of Takeuchi's criterion (1976)."""
        return self.result.group.size * max(self.result.entry.cell.dispersion, 1.0)

    @property
    def net_gain(self) -> float:
        """Gain less penalty."""
        return self.gain - self.penalty


def _choose(
    model: FittedModel,
    evidence: SelectionEvidence,
    candidates: Sequence[GroupTest],
    rejected: Collection[str],
    settings: Settings,
) -> tuple[FittedModel, GroupTest] | frozenset[str]:
    """The model with the best candidate, and which it is; or the names of candidates whose exact gain is chance."""
    best = _first(candidates)
    if best.group.is_shared:
        term = Term(best.group, best.p_value, best.gain, best.gain)
        return replace(model, terms=(*model.terms, term)), best
    same_order = [
        result for result in candidates if result.group.order == best.group.order and not result.group.is_shared
    ]
    results = [result for result in evidence.results if result.group.name not in rejected]
    shortlist: list[GroupTest] = []
    for family in FAMILIES[: FAMILIES.index(best.group.family) + 1]:  # an error also shows in later families
        of_family = [result for result in same_order if result.group.family == family]
        shortlist += _shortlist(sorted(of_family, key=lambda result: result is not best), settings)
    shortlist += _later(best, same_order)
    shortlist += _turned(best, results, shortlist)
    trials = []
    for result in shortlist:
        # Shape parameters of effects start far from their values.
        steps = settings.descent.steps if result.group.is_effect else _ROUGH_STEPS
        after, _ = refit_with(
            model, evidence.linearisation, result.group, result.entry.coefficients, fine=False, steps=steps
        )
        trials.append(_Trial(result, after.loglik - model.loglik, after))
    _LOG.debug("tried %s", [(one.result.group.name, round(one.result.gain, 1), round(one.gain, 1)) for one in trials])
    trial = _simplest(trials, settings)
    needed = {one: needed_gain(one.result.group, model, settings) for one in trials}
    if trial.net_gain < needed[trial]:
        return frozenset(one.result.group.name for one in trials if one.net_gain < needed[one])
    result = trial.result
    after, group = trial.model, result.group
    if not group.is_effect:
        after, group = _refined(model, evidence, trial)
    if after.loglik - model.loglik - trial.penalty < needed_gain(group, model, settings):
        return frozenset({result.group.name})
    if group.frequency_hz:
        after, group = _best_alias(model, evidence, after, group)
    p_value, gain = result.p_value, after.loglik - model.loglik
    if p_value > settings.selection.level:
        rng = np.random.default_rng([len(model.terms), settings.selection.confirm_draws])
        p_value = p_about_fit(after, group, gain, evidence.dictionary.tested, settings.selection, rng)
        if p_value > settings.selection.level:
            return frozenset({result.group.name})
    alternatives = _rivals(trial, trials)
    penalty = group.size * max(result.entry.cell.dispersion, 1.0)
    term = Term(group, p_value, result.gain, gain, penalty, alternatives)
    return replace(after, terms=(*model.terms, term)), result


def _refined(model: FittedModel, evidence: SelectionEvidence, trial: _Trial) -> tuple[FittedModel, Group]:
    """A dependence fitted to convergence, in its finest bins where these are more likely than those of the trial."""
    result = trial.result
    for fine in (True, False):
        after, group = refit_with(
            model, evidence.linearisation, result.group, result.entry.coefficients, fine=fine, steps=_STEPS
        )
        if after.loglik - model.loglik >= trial.gain or group is result.group:
            break
    return after, group


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
            after, other = refit_with(model, linearisation, other, np.zeros(2), fine=True, steps=_STEPS)
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
    return _each_kind_once([*shortlist, *named[:3]])


def _later(best: GroupTest, candidates: Sequence[GroupTest]) -> list[GroupTest]:
    """The leading effect of each later family.

    The refit of a candidate uses all data: darker returns are also lost more often, so that a change of intensities can
    fit losses that an effect of the returns explains better.
    """
    leading = {}
    for result in sorted(candidates, key=lambda result: -result.gain):
        if result.group.is_effect:
            leading.setdefault(result.group.family, result)
    return [leading[family] for family in FAMILIES[FAMILIES.index(best.group.family) + 1 :] if family in leading]


def _turned(best: GroupTest, results: Sequence[GroupTest], shortlist: Sequence[GroupTest]) -> list[GroupTest]:
    """Hypotheses that turn beams, whatever their linear gain: they are far from linear.

    Beams that are turned far from where they were predicted look like returns of no surface.
    """
    if best.group.order or best.group.channel in SPREADS or best.group.family == "intensity":
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
        return max(named, key=lambda trial: trial.gain)
    near = [
        trial
        for trial in trials
        if trial.net_gain > best.net_gain - max(by.simpler * best.gain, 8.0) and trial.net_gain > 0
    ]
    return min(near or [best], key=lambda trial: _complexity(trial.result.group))


def _complexity(group: Group) -> int:
    return group.size + 10 * len(group.covariates) - 5 * group.is_effect


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

"""Stepwise selection: shortlist by cross-fitted linear gains, choose by exact refits, delete what became superfluous."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.dictionary.build import Dictionary, build_dictionary
from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.linearisation import Linearisation, linearise
from cosim.discrepancy.dictionary.shared_errors import shared_errors
from cosim.discrepancy.inference.dependence import ANGLES, SPREADS
from cosim.discrepancy.inference.projection import TRACK
from cosim.discrepancy.selection.first_pass import first_pass
from cosim.discrepancy.selection.refit import Model, Term, refit_with, refit_without
from cosim.discrepancy.selection.table import TestResult, evaluate, score_groups, score_shared
from cosim.discrepancy.settings import Settings
from sensors.effects.base import Effect

_LOG = logging.getLogger(__name__)
_ROUGH_STEPS, _STEPS = 4, 10
_SAME_HZ = 1.0


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the scores about a model show.

    Attributes:
        linearisation: of the model.
        dictionary: all hypotheses.
        results: of those that the first pass kept, the largest gain first.
    """

    linearisation: Linearisation
    dictionary: Dictionary
    results: list[TestResult]

    def significant(self, settings: Settings) -> list[TestResult]:
        """Results at or below the level that gain something on clusters that took no part."""
        least = settings.selection.least_gain
        return [one for one in self.results if one.p_value <= settings.level and one.gain >= least]


def gather_evidence(model: Model, effects: Sequence[Group], settings: Settings, seed: int) -> Evidence:
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
    return Evidence(linearisation, dictionary, results)


def select_terms(
    model: Model,
    tangents: Callable[[Linearisation, Model], Sequence[Group]],
    initial: Sequence[Effect],
    settings: Settings,
    seed: int,
    retrace: Callable[[Model], Model],
    on_progress: Callable[[str], None],
    on_first: Callable[[Evidence], None] = lambda _: None,
) -> tuple[Model, Evidence]:
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
            for result in evidence.significant(settings)
            if result.group.name not in rejected
            and not _is_selected(result.group, model)
            and result.gain >= _needed_gain(result.group, model, settings)
        ]
        chosen = _choose(model, evidence, candidates, settings)
        if chosen is None:
            break
        before, (model, result) = model, chosen
        on_progress(f"added {result.group.name}: gain {result.gain:.1f}, p {result.p_value:.4f}")
        model = drop_superfluous(model, initial, settings, rejected, on_progress)
        if not result.group.is_shared:
            model = retrace(model)
        if model.fitted.effects != before.fitted.effects:
            effects = tangents(linearise(model.fitter, model.fitted, model.frames), model)
        evidence = gather_evidence(model, effects, settings, seed)
    return model, evidence


def drop_superfluous(
    model: Model,
    initial: Sequence[Effect],
    settings: Settings,
    rejected: set[str],
    on_progress: Callable[[str], None] = lambda _: None,
) -> Model:
    """The model without the terms that the latest one has made superfluous; their names go to `rejected`."""
    for term in [term for term in model.terms[:-1] if not term.group.is_shared]:
        if term.group.channel in SPREADS:
            continue
        less = refit_without(model, term, initial, _STEPS)
        loss = model.loglik - less.loglik
        if loss < settings.selection.least_follower + term.group.size:
            on_progress(f"removed {term.group.name}: {loss:.1f} less likely without it")
            rejected.add(term.group.name)
            model = less
        else:
            updated = replace(term, exact_gain=loss)
            model = replace(model, terms=tuple(updated if other is term else other for other in model.terms))
    return model


def _is_selected(group: Group, model: Model) -> bool:
    """Whether the same dependence was selected already, in these or other bins: fitting it again changes nothing."""
    if group.is_effect:
        return False
    selected = [term.group for term in model.terms if term.group.channel == group.channel and not term.group.is_effect]
    if group.frequency_hz:
        return any(abs(other.frequency_hz - group.frequency_hz) < _SAME_HZ for other in selected)
    if group.covariate is None:
        return any(other.name == group.name for other in selected)
    return any(other.covariate is not None and set(other.covariates) == set(group.covariates) for other in selected)


def _needed_gain(group: Group, model: Model, settings: Settings) -> float:
    """Log-likelihood that a term must gain: the first one little, a follower more than a small share of the largest.

    A fit of a strong term is never exact to its last share.
    """
    by = settings.selection
    if not model.terms:
        return by.least_gain
    family = [term.exact_gain for term in model.terms if term.group.family == group.family]
    largest = max((term.exact_gain for term in model.terms), default=0.0)
    return max(by.least_follower, by.follower_share * max(family, default=0.0), 1e-3 * largest)


def _choose(
    model: Model, evidence: Evidence, candidates: Sequence[TestResult], settings: Settings
) -> tuple[Model, TestResult] | None:
    """The model with the best candidate, and which it is; None without any."""
    if not candidates:
        return None
    systematic = [result for result in candidates if not result.group.is_random]
    best = candidates[0]
    if not systematic and not best.group.is_shared:
        systematic = [result for result in candidates if not result.group.is_shared]
    if not systematic:
        term = Term(best.group, best.p_value, best.gain, best.gain)
        return replace(model, terms=(*model.terms, term)), best
    best = systematic[0]
    if best.group.channel in SPREADS:  # a wrong mean looks like spread
        means = [
            result
            for result in systematic
            if result.group.family == best.group.family and result.group.channel not in SPREADS
        ]
        best = next((result for result in means if result.gain > 0.2 * best.gain), best)
    tried = []
    for result in _shortlist(best, systematic, evidence, settings):
        after, _ = refit_with(
            model, evidence.linearisation, result.group, result.entry.coefficients, fine=False, steps=_ROUGH_STEPS
        )
        tried.append((result, after.loglik - model.loglik))
    _LOG.debug("tried %s", [(result.group.name, round(result.gain, 1), round(gain, 1)) for result, gain in tried])
    result = _simplest(tried, settings)
    after, group = refit_with(
        model, evidence.linearisation, result.group, result.entry.coefficients, fine=True, steps=_STEPS
    )
    rivals = tuple(other.group.name for other, gain in tried if other is not result and _is_rival(gain, tried, result))
    term = Term(group, result.p_value, result.gain, after.loglik - model.loglik, rivals)
    return replace(after, terms=(*model.terms, term)), result


def _shortlist(
    best: TestResult, candidates: Sequence[TestResult], evidence: Evidence, settings: Settings
) -> list[TestResult]:
    """Groups that may be the same thing as the best one: of its family, with much of its gain, each kind once.

    Turned beams are far from linear, so that the best of them are refitted whatever their linear gain.
    """
    by, family = settings.selection, best.group.family
    near = [result for result in candidates if result.group.family == family]
    picked = [result for result in near if result.gain >= by.rival_share * best.gain]
    seen: set[tuple] = set()
    shortlist: list[TestResult] = []
    for result in [best, *picked]:
        key = _kind(result.group)
        if key not in seen and len(shortlist) < by.rivals + 1:
            seen.add(key)
            shortlist.append(result)
    named = [
        result
        for result in near
        if result.group.is_effect and result.group.size <= 2 and result.gain >= 0.3 * best.gain
    ]
    turned = []
    if family == "range" and best.group.channel != "range_variance" and not best.group.is_random:
        systematic = [other for other in evidence.results if not other.group.is_random and other.entry.z > 3]
        for channel in ANGLES:
            turned += [other for other in systematic if other.group.channel == channel][:3]
    for result in [*named[:3], *turned]:
        key = _kind(result.group)
        if key not in seen:
            seen.add(key)
            shortlist.append(result)
    return shortlist


def _kind(group: Group) -> tuple:
    """What makes two groups the same hypothesis in other bins or at another setting."""
    return (
        group.channel,
        group.effect_name,
        group.covariates,
        round(group.frequency_hz, 2),
        group.name if not group.covariates and not group.is_effect else "",
    )


def _simplest(tried: Sequence[tuple[TestResult, float]], settings: Settings) -> TestResult:
    """The candidate of the largest exact gain less its parameters; a named or simpler one that gains nearly as much."""
    by = settings.selection
    worth = {id(result): gain - result.group.size for result, gain in tried}
    best, top = max(tried, key=lambda row: worth[id(row[0])])
    named = [
        (result, gain)
        for result, gain in tried
        if result.group.is_effect and result.group.size <= 2 and gain > (1 - by.named) * top
    ]
    if named:
        return max(named, key=lambda row: row[1])[0]
    near = [result for result, _ in tried if worth[id(result)] > worth[id(best)] - max(by.simpler * top, 8.0)]
    return min(near or [best], key=_complexity)


def _complexity(result: TestResult) -> int:
    group = result.group
    return group.size + 10 * len(group.covariates) - 5 * group.is_effect


def _is_rival(gain: float, tried: Sequence[tuple[TestResult, float]], chosen: TestResult) -> bool:
    """Whether an exact gain is within two standard errors of that of the chosen group."""
    own = next(value for result, value in tried if result is chosen)
    return gain > own - 2 * np.sqrt(max(own, 1.0)) and gain > 0.7 * own

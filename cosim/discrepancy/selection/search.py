"""Stepwise selection: add the best term, delete what became superfluous, and repeat."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.linearisation import Linearisation, linearise
from cosim.discrepancy.inference.dependence import SPREADS
from cosim.discrepancy.selection.choice import STEPS, Rejected, choose, needed_gain
from cosim.discrepancy.selection.evidence import SelectionEvidence, gather_evidence
from cosim.discrepancy.selection.refit import FittedModel, fit_again, refit_without
from cosim.discrepancy.selection.table import GroupTest
from cosim.discrepancy.settings import Settings
from sensors.effects.base import Effect

_LOG = logging.getLogger(__name__)
_SAME_HZ = 1.0


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
    by, rejected, insignificant = settings.selection, set[str](), set[str]()
    # Candidates for ranges are fitted with an inflated σ first, which may find a better optimum of the random effects.
    again = fit_again(model, model.fitted.effects, model.free, model.fitted.dependences, STEPS, widened=True)
    model = replace(model, fitted=max(model.fitted, again, key=lambda fitted: fitted.loglik))
    effects = tangents(linearise(model.fitter, model.fitted, model.frames), model)
    evidence = gather_evidence(model, effects, settings, seed)
    on_first(evidence)
    while len(model.terms) < by.steps:
        candidates = [
            result
            for result in evidence.candidates(settings)
            if result.group.name not in rejected | insignificant
            and not is_explained(result.group, model)
            and result.gain >= needed_gain(result.group, model, settings)
        ]
        if not candidates:
            break
        chosen = choose(model, evidence, candidates, rejected | insignificant, settings)
        if isinstance(chosen, Rejected):
            reason = "fits gain no more than chance" if chosen.is_chance else "not significant"
            on_progress(f"rejected {', '.join(sorted(chosen.names))}: {reason}")
            (rejected if chosen.is_chance else insignificant).update(_same_effects(chosen.names, candidates))
            continue
        insignificant.clear()  # next to the new term they may be significant
        before, (model, result) = model, chosen
        term = model.terms[-1]
        on_progress(f"added {term.group.name}: gain {term.exact_gain:.1f}, p {term.p_value:.4f}")
        model = drop_superfluous(model, initial, settings, rejected, on_progress)
        if not result.group.is_shared:
            model = retrace(model)
        if model.fitted.effects != before.fitted.effects:
            effects = tangents(linearise(model.fitter, model.fitted, model.frames), model)
            if not term.group.is_shared:
                model = replace_dependences(model, effects, initial, settings, seed, rejected, on_progress)
        evidence = gather_evidence(model, effects, settings, seed)
    return model, replace(evidence, rejected=frozenset(rejected | insignificant))


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
        less = refit_without(model, term, initial, STEPS)
        evidence = gather_evidence(less, effects, settings, seed)
        candidates = [
            result
            for result in evidence.candidates(settings)
            if result.group.name not in rejected
            and result.group.family == family
            and result.group.order == 0
            and not is_explained(result.group, less)
        ]
        chosen = choose(less, evidence, candidates, rejected, settings) if candidates else None
        if isinstance(chosen, tuple) and chosen[1].group.hypothesis != group.hypothesis:
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
    """The model without the terms that the latest one has made superfluous; their names go to `rejected`.

    An effect that is a special case of the latest term is kept: the bins of that term contain it, and describe what
    differs from it (principle of marginality: Nelder, J. R. Stat. Soc. A 140, 1977).
    """
    latest = model.terms[-1].group
    for term in [term for term in model.terms[:-1] if not term.group.is_shared]:
        if term.group.channel in SPREADS or (term.group.is_effect and term.group.is_special_case_of(latest)):
            continue
        less = refit_without(model, term, initial, STEPS)
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

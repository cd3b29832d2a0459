"""What a sensor model is missing: terms of the dictionary, and the plug-ins that are made of them.

Both `compare` and `diagnose` use it, on the same frames, so that they do not contradict each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from cosim.discrepancy.analysis import Context, FittedFrames, fit_held_out, is_accurate, trace_and_fit
from cosim.discrepancy.candidates import is_unchanged
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.dictionary.effects import effect_groups
from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.linearisation import Linearisation, linearise
from cosim.discrepancy.inference.dependence import SPURIOUS
from cosim.discrepancy.inference.intervals import intervals
from cosim.discrepancy.inference.parameters import all_free
from cosim.discrepancy.selection.curves import curve_of
from cosim.discrepancy.selection.evidence import SelectionEvidence
from cosim.discrepancy.selection.refit import FittedModel, Term, rebuild
from cosim.discrepancy.selection.search import select_terms
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import effect_of
from sensors.effects.base import Effect


@dataclass(frozen=True, eq=False)
class ReportedTerm:
    """A term in reported form: an effect of the catalogue, a plug-in, or a property of the file."""

    name: str
    p_value: float
    alternatives: tuple[str, ...] = ()
    unknown: UnknownEffect | None = None
    term: str = ""
    interval: dict[str, list[float]] | None = None

    @property
    def is_shared(self) -> bool:
        """Whether it is an error that several beams have in common."""
        return self.unknown is not None and self.unknown.curve.is_shared


@dataclass(frozen=True, eq=False)
class Missing:
    """Terms that a model is missing on the frames to fit.

    Attributes:
        model: with the terms.
        findings: effects and plug-ins, in the order in which they were added.
        phases: dependences that no formula predicts.
        first, last: evidence about the model before and after.
        ci95: intervals of the model's parameters by effect.
    """

    model: FittedModel
    findings: tuple[ReportedTerm, ...]
    phases: tuple[Term, ...]
    first: SelectionEvidence
    last: SelectionEvidence
    ci95: dict[str, dict[str, Any]]

    def without(self, context: Context, findings: Sequence[ReportedTerm]) -> Missing:
        """The model fitted without some findings, which are listed as unexplained."""
        model, names = self.model, [one.name for one in findings]
        for name in names:
            model = _without_effect(context, model, name)
        terms = {term.group.effect_name or term.group.name: term for term in self.model.terms}
        listed = (terms.get(one.term or one.name) for one in findings)
        left = tuple(one for one in self.findings if one.name not in names)
        phases = (*self.phases, *(term for term in listed if term is not None))
        return replace(self, model=model, findings=left, phases=phases, ci95=_intervals(model))

    def without_findings(self, model: FittedModel) -> Missing:
        """Nothing missing: the model before the search, with everything significant unexplained."""
        return Missing(model, (), (), self.first, self.first, _intervals(model))

    def held_out(self, context: Context, traced: Sequence[TracedFrame] | None = None) -> FittedFrames:
        """The held-out frames, to which only nuisance parameters are fitted; the others if none is held out."""
        fitted = self.model.fitted
        if not context.split.is_held_out:
            return FittedFrames(context.split.fit, self.model.frames, self.model.fitter, fitted)
        return fit_held_out(context, fitted.effects, traced=traced)


def find_missing(context: Context, model: FittedModel) -> Missing:
    """Select terms, turn them into effects, and drop those whose intervals include no change."""
    first, last, selected = select(context, model)
    selected, findings, phases = convert_terms(context, selected)
    selected, findings, dropped, ci95 = drop_insignificant(context, selected, findings)
    return Missing(selected, findings, (*phases, *dropped), first, last, ci95)


def select(context: Context, model: FittedModel) -> tuple[SelectionEvidence, SelectionEvidence, FittedModel]:
    """Select terms; the evidence about the model before and after, and the model with its terms."""
    first: list[SelectionEvidence] = []

    def tangents(linearisation: Linearisation, current: FittedModel) -> list[Group]:
        return effect_groups(linearisation, context.candidates, (), current.free)

    model, last = select_terms(
        model, tangents, context.initial_effects, context.settings, context.seed,
        lambda current: retrace(context, current), context.on_progress, first.append,
    )  # fmt: skip
    return first[0], last, model


def retrace(context: Context, model: FittedModel) -> FittedModel:
    """Trace the frames again where the effects bend beams too far from where they were traced, and fit again."""
    if is_accurate(model.fitter, model.fitted.effects):
        return model
    context.on_progress("tracing bent beams again")
    on = trace_and_fit(context, context.split.fit, model.fitted.effects, model.free)
    return rebuild(model, on)


def convert_terms(
    context: Context, model: FittedModel
) -> tuple[FittedModel, tuple[ReportedTerm, ...], tuple[Term, ...]]:
    """Turn dependences into plug-ins, and fit their parameters together with everything else.

    Returns:
        The model without dependences; the findings, in order; and terms that no formula predicts.
    """
    linearisation = linearise(model.fitter, model.fitted, model.frames)
    effects, free = model.fitted.effects, model.free
    findings, phases = list[ReportedTerm](), list[Term]()
    for term in model.terms:
        names = term.alternatives
        if term.group.is_effect:
            findings.append(ReportedTerm(term.group.effect_name, term.p_value, names))
            continue
        curve = curve_of(linearisation, term, context.settings.selection.sectors)
        is_there = curve is not None and any(effect.name == curve.name for effect in effects)
        if curve is None or (is_there and not curve.is_shared):
            phases.append(term)
            continue
        unknown = UnknownEffect.of(curve)
        if not curve.is_shared and curve.channel not in SPURIOUS:  # these have their most likely size already
            free = (*free, len(effects))
        if not is_there:  # shared errors are effects already
            effects = (*effects, effect_of(unknown))
        findings.append(ReportedTerm(unknown.name, term.p_value, names, unknown, term.group.name))
    if effects == model.fitted.effects and not model.fitted.dependences:
        return model, tuple(findings), tuple(phases)
    context.on_progress("fitting formulas")
    fitted = model.fitter.fit(effects, all_free(effects, free, model.fitter.rings), model.fitted.estimate)
    converted = retrace(context, replace(model, fitted=fitted, free=free, terms=()))
    return replace(converted, terms=model.terms), tuple(findings), tuple(phases)


def drop_insignificant(
    context: Context, model: FittedModel, findings: Sequence[ReportedTerm]
) -> tuple[FittedModel, tuple[ReportedTerm, ...], tuple[Term, ...], dict[str, dict[str, Any]]]:
    """Drop findings of which every amplitude's interval includes no change, and plug-ins that gain nothing.

    One after the other, the latest first, and the rest is fitted again: if two findings compensate each other, both
    intervals include no change, but that of the first does not without the second. No change is the neutral value of
    an added effect, and the given value of an effect that the sensor has.

    Returns:
        The model; the findings that are left; terms of dropped plug-ins, whose curves no formula describes; and the
        intervals of the model's parameters.
    """
    findings, terms = tuple(findings), {term.group.name: term for term in model.terms}
    listed, ci95 = list[Term](), _intervals(model)
    while idle := _latest_idle(context, model, findings, ci95):
        context.on_progress(f"dropped {idle.name}: its influence does not differ from none")
        model = _without_effect(context, model, idle.name)
        ci95 = _intervals(model)
        findings = tuple(one for one in findings if one is not idle)
        if idle.unknown is not None:
            listed.append(terms[idle.term])
    return model, findings, tuple(listed), ci95


def _intervals(model: FittedModel) -> dict[str, dict[str, Any]]:
    return intervals(model.fitter, model.fitted) if model.fitted.free else {}


def _latest_idle(
    context: Context, model: FittedModel, findings: Sequence[ReportedTerm], ci95: dict[str, dict[str, Any]]
) -> ReportedTerm | None:
    """The latest finding without an influence that differs from none, or nothing."""
    testable = [one for one in reversed(findings) if one.interval is None and not one.is_shared]
    is_idle = (
        one for one in testable
        if _is_unchanged(model, one.name, ci95.get(one.name, {}), context.initial_effects)
        or (_is_fitted(one) and _gain_of(model, one.name) < context.settings.selection.least_follower)
    )  # fmt: skip
    return next(is_idle, None)


def _is_fitted(finding: ReportedTerm) -> bool:
    """Whether a finding is a plug-in whose gain is that of the likelihood, which omits spurious returns near edges."""
    return finding.unknown is not None and finding.unknown.curve.channel not in SPURIOUS


def _gain_of(model: FittedModel, name: str) -> float:
    """Log-likelihood that the model loses without an effect, if all others keep their parameters."""
    effects, loss = model.fitted.effects, model.fitter.loss(model.fitted.estimate)
    return loss(tuple(effect for effect in effects if effect.name != name)) - loss(effects)


def _without_effect(context: Context, model: FittedModel, name: str) -> FittedModel:
    """The model fitted without an effect, or with the given parameters of an effect that the sensor has."""
    initial, effects = context.initial_effects, model.fitted.effects
    index = next(index for index, effect in enumerate(effects) if effect.name == name)
    names = {effects[other].name for other in model.free if other != index}
    replaced = (initial[index],) if index < len(initial) else ()
    effects = (*effects[:index], *replaced, *effects[index + 1 :])
    free = tuple(index for index, effect in enumerate(effects) if effect.name in names)
    fitted = model.fitter.fit(effects, all_free(effects, free, model.fitter.rings), model.fitted.estimate)
    return replace(model, fitted=fitted, free=free)


def _is_unchanged(model: FittedModel, name: str, ci95: dict[str, Any], initial: Sequence[Effect]) -> bool:
    """Whether the intervals of all parameters that switch an effect on include their neutral or given values."""
    index = next(i for i, effect in enumerate(model.fitted.effects) if effect.name == name)
    kind = type(model.fitted.effects[index])
    if kind.neutral is None:
        return False
    return is_unchanged(kind, ci95, initial[index].model_dump() if index < len(initial) else kind.neutral)

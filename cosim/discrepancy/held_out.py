"""The check on held-out frames: error and budget of what was found; findings that raise the error are withdrawn.

`compare` and `diagnose` both use it, so that they do not contradict each other.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from cosim.discrepancy.analysis import Context
from cosim.discrepancy.budget import ALIGNED, Budget, FramePairs, budget_of
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.missing import Missing, ReportedTerm
from cosim.discrepancy.selection.refit import FittedModel
from sensors.effects.base import BeamEffect, Effect


@dataclass(frozen=True, eq=False)
class HeldOutCheck:
    """What a sensor is missing, with the errors of held-out frames.

    Attributes:
        missing: findings.
        budget: of the error.
        frame_pairs: the frames under the initial and the final model.
        needed: names of findings after which the error rises, but without which that of all together is higher.
    """

    missing: Missing
    budget: Budget
    frame_pairs: FramePairs
    needed: frozenset[str]

    def harmful(self, context: Context) -> tuple[ReportedTerm, ...]:
        """Findings that raise the aligned error by more than a share, and significantly, and that others do not need.

        A map of the drive's own scans was made with the initial effects: only a map made again with the findings can
        contradict those that move points.
        """
        findings, by = self.missing.findings, context.settings
        if self.missing.model.fitter.sample.of_own_map:
            return ()
        steps = self.budget.aligned_steps[len(self.budget.aligned_steps) - len(findings) - 1 :]
        return tuple(
            one
            for one, before, after in zip(findings, steps, steps[1:], strict=False)
            if one.name not in self.needed and before.rises_to(after, by.at_floor, by.level)
        )

    def is_contradicted(self, context: Context) -> bool:
        """Whether all findings together raise the error, so that they cannot be the cause; see `harmful`."""
        if not self.missing.findings or (self.missing.model.fitter.sample.of_own_map and self._moves_points):
            return False
        return self.budget.is_raised(context.settings.at_floor, context.settings.level)

    @property
    def _moves_points(self) -> bool:
        """Whether any finding changes where points lie."""
        found, effects = {one.name for one in self.missing.findings}, self.missing.model.fitted.effects
        moving = (effect for effect in effects if isinstance(effect, BeamEffect) or effect.channel == "range")
        return any(effect.name in found for effect in moving)


def check_held_out(
    context: Context,
    missing: Missing,
    initial: FittedModel,
    facts: Sequence[ReportedTerm] = (),
    traced: Sequence[TracedFrame] | None = None,
) -> HeldOutCheck:
    """Measure held-out frames, and withdraw the findings that raise their error: first single ones, then all.

    Args:
        context: of the analysis.
        missing: what was found on the frames to fit.
        initial: model before.
        facts: findings about the file, which come before the others and are not withdrawn.
        traced: held-out frames, traced for the initial effects.
    """
    found = _measured(context, missing, facts, traced)
    harmful = found.harmful(context)
    if harmful:
        names = ", ".join(one.name for one in harmful)
        context.on_progress(f"{names}: the error of held-out frames rises; listed as unexplained")
        found = _measured(context, missing.without(context, harmful), facts, traced)
    if found.is_contradicted(context):
        context.on_progress("the findings raise the error of held-out frames: they are listed as unexplained")
        found = _measured(context, missing.without_findings(initial), facts, traced)
    return found


def _measured(
    context: Context, missing: Missing, facts: Sequence[ReportedTerm], traced: Sequence[TracedFrame] | None
) -> HeldOutCheck:
    effects, findings = missing.model.fitted.effects, (*facts, *missing.findings)
    is_same = context.bending(effects) == context.bending(context.initial_effects)
    on = missing.held_out(context, traced if is_same else None)
    budget, frame_pairs = budget_of(context, on, _steps(context, effects, findings))
    return HeldOutCheck(missing, budget, frame_pairs, _needed(context, frame_pairs, budget, effects, findings))


def _steps(
    context: Context, effects: tuple[Effect, ...], findings: Sequence[ReportedTerm], left_out: str = ""
) -> list[tuple[Effect, ...]]:
    """The model after each finding, with the final values of those found so far, and without `left_out`."""
    initial = context.initial_effects
    names = {*(one.name for one in findings), left_out}
    final = {effect.name: effect for effect in effects}
    own = [final[effect.name] if effect.name in context.refitted else effect for effect in initial]
    models, present = [tuple(own)], set[str]()
    for one in findings:
        present.add(one.name)
        there = [final[effect.name] if effect.name in present else effect for effect in own]
        added = [effect for effect in effects[len(initial) :] if effect.name in present or effect.name not in names]
        models.append((*there, *added))
    return models


def _needed(
    context: Context,
    frame_pairs: FramePairs,
    budget: Budget,
    effects: tuple[Effect, ...],
    findings: Collection[ReportedTerm],
) -> frozenset[str]:
    """Names of findings after which the error rises, but without which the error of all together is higher.

    Effects that compensate each other, such as gains of lasers and a falloff with range, lower the error only together.
    """
    errors, found = [step.error for step in budget.aligned_steps], set[str]()
    for one, before, after in zip(findings, errors, errors[1:], strict=False):
        if after >= before and len(findings) > 1:
            others = [other for other in findings if other is not one]
            without = frame_pairs.align(_steps(context, effects, others, left_out=one.name)[-1])
            if without.error(ALIGNED) > errors[-1]:
                found.add(one.name)
    return frozenset(found)

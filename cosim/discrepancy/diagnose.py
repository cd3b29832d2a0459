"""Diagnosis: physical effects missing from a sensor model.

Fit the nuisance parameters, test every hypothesis of one dictionary, add the best term by exact refits, repeat; turn
terms that are no effects of the catalogue into plug-ins; measure errors on held-out frames.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import stats

from cosim.discrepancy.analysis import (
    Context,
    FittedFrames,
    context_of,
    trace_and_fit,
)
from cosim.discrepancy.data.checks import check_fit, drive_notes, fit_notes, opened
from cosim.discrepancy.data.wiring import Exchange, exchange_notes, exchanged_rings
from cosim.discrepancy.diagnosis import Alternative, Diagnosis, Finding
from cosim.discrepancy.dictionary.covariates import sample_covariates
from cosim.discrepancy.dictionary.lattices import find_lattices
from cosim.discrepancy.dictionary.linearisation import linearise
from cosim.discrepancy.evidence_matrix import evidence_matrix
from cosim.discrepancy.held_out import HeldOutCheck, check_held_out
from cosim.discrepancy.missing import ReportedTerm, find_missing
from cosim.discrepancy.selection.curves import rest_of_curve
from cosim.discrepancy.selection.evidence import SelectionEvidence
from cosim.discrepancy.selection.refit import FittedModel, Term
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.discrepancy.unexplained import Unexplained, remaining
from cosim.discrepancy.unknown.curve import Curve
from cosim.drives.kitti import Drive
from cosim.drives.twin.surfels import has_surfels
from cosim.labels.bias import Certainty, diagnose_labels
from sensors.effects.base import Effect, LabelEffect
from sensors.effects.lasers import as_known
from sensors.sensor_model import SensorModel

_LOG = logging.getLogger(__name__)


def diagnose(
    drive: Drive | str | Path,
    sensor: SensorModel | str | Path,
    *,
    frames: Sequence[str] | None = None,
    extra: Sequence[type[Effect]] = (),
    seed: int = 0,
    settings: Settings = DEFAULT,
    refitted: Sequence[str] = (),
    on_progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Find the effects missing from a sensor model, given a measured drive.

    Args:
        drive: measured, with a twin, or its folder.
        sensor: model, or its file.
        frames: frames to use; all by default.
        extra: effects to test in addition to the catalogue and the installed ones.
        seed: of samples, signs and folds.
        settings: numeric choices.
        refitted: names of effects of the sensor whose parameters are fitted from the beginning.
        on_progress: called with a message for each step.

    Raises:
        CosimError: the drive has no points or no twin, or the twin does not match it.
        SensorError: the sensor file is invalid.
    """
    measured = opened(drive)
    context = context_of(
        measured, sensor, frames=frames, extra=extra, seed=seed, settings=settings, refitted=refitted,
        on_progress=on_progress or _LOG.debug,
    )  # fmt: skip
    on, exchanged = check_wiring(context, fit_nuisances(context))
    on, facts = add_lattices(context, on)
    model = FittedModel(on.frames, on.fitter, on.fitted, _initially_free(context))
    missing = find_missing(context, model)
    context.on_progress("measuring errors on held-out frames")
    check = check_held_out(context, missing, model, facts)
    diagnosis = conclude(context, check, facts, exchanged)
    return add_labels(diagnosis, measured)


def fit_nuisances(context: Context) -> FittedFrames:
    """Trace the frames to fit, check that the twin matches them, and fit the nuisance parameters."""
    context.on_progress("tracing the twin and fitting poses, objects and map")
    first = context.tracer.trace(context.split.fit[0], ())
    check_fit(first, context.tracer.drive)
    effects = context.initial_effects
    return trace_and_fit(context, context.split.fit, effects, _initially_free(context))


def check_wiring(context: Context, on: FittedFrames) -> tuple[FittedFrames, tuple[Exchange, ...]]:
    """Find exchanged lasers; their beams take no part in the diagnosis."""
    exchanged = exchanged_rings(on.frames)
    if not exchanged:
        return on, ()
    context.on_progress(f"rings {', '.join(str(one.ring) for one in exchanged)} are exchanged with others")
    context.tracer.exclude_rings([one.ring for one in exchanged])
    return trace_and_fit(context, context.split.fit, context.initial_effects, _initially_free(context)), exchanged


def add_lattices(context: Context, on: FittedFrames) -> tuple[FittedFrames, tuple[ReportedTerm, ...]]:
    """Add the steps of which measured values are multiples and the model's are not: facts of the file."""
    rng, findings = np.random.default_rng([context.seed, 3]), []
    for lattice in find_lattices(on.fitter, on.fitted, context.candidates, rng):
        others = tuple(effect for effect in on.fitted.effects if effect.name != lattice.effect.name)
        on = replace(on, fitted=on.fitter.fit((*others, lattice.effect), (), on.fitted.estimate, steps=3))
        p_value = 1 / context.settings.selection.draws
        findings.append(ReportedTerm(lattice.effect.name, p_value, interval=lattice.interval))
    return on, tuple(findings)


def conclude(
    context: Context, check: HeldOutCheck, facts: Sequence[ReportedTerm], exchanged: Sequence[Exchange]
) -> Diagnosis:
    """Findings with intervals, errors and their budget, and everything that remains.

    Args:
        context: of the analysis.
        check: what the sensor is missing, with the errors of held-out frames.
        facts: findings about the file, which come before the others.
        exchanged: lasers that are exchanged with others.
    """
    missing, budget = check.missing, check.budget
    model, first, last = missing.model, missing.first, missing.last
    fitted, findings = model.fitted, (*facts, *missing.findings)
    on, ci95 = FittedFrames(context.split.fit, model.frames, model.fitter, fitted), missing.ci95
    effects, unknowns, rests = [], [], _rests(context, model, missing.findings)
    for number, one in enumerate(findings):
        effect = next(effect for effect in fitted.effects if effect.name == one.name)
        params, interval = effect.model_dump(mode="json"), ci95.get(one.name, one.interval or {})
        if one.unknown is not None:
            unknowns.append(one.unknown.refitted(params, interval, rests.get(one.name)))
            continue
        similar = tuple(dict.fromkeys(name for name in one.alternatives if name in _catalogue(context)))
        steps = budget.steps[number], budget.steps[number + 1]
        effects.append(Finding(one.name, params, interval, one.p_value, *steps, similar))
    sets = tuple((one.name, *one.alternatives) for one in findings if one.alternatives)
    return Diagnosis(
        effects=tuple(effects),
        ranking=_ranking(first),
        unknowns=tuple(unknowns),
        unexplained=(*_wiring(exchanged), *_unexplained(context, model, missing.phases, last)),
        either_or=sets,
        evidence=evidence_matrix(first, last),
        smallest_detectable=_smallest(last, context.settings),
        budget=budget,
        sensor=SensorModel(context.sensor.pattern, as_known(fitted.effects), context.sensor.origin),
        split=context.split,
        spreads=_spreads(on),
        notes=(*exchange_notes(exchanged), *_notes(context, on)),
        frame_pairs=check.frame_pairs,
        needed=check.needed,
        settings=context.settings,
        refitted={
            effect.name: {"params": effect.model_dump(mode="json"), "ci95": ci95.get(effect.name, {})}
            for effect in fitted.effects
            if effect.name in context.refitted
        },
    )


def add_labels(diagnosis: Diagnosis, drive: Drive) -> Diagnosis:
    """Test the labels as well; a missing label effect goes into the improved sensor.

    The verdict is that of the points unless no effect is missing there.
    """
    if not any(drive[name].has("label_2") for name in drive.frames):
        return diagnosis
    by = diagnosis.settings
    labels = diagnose_labels(drive, diagnosis.sensor, certainty=Certainty(by.level, by.coverage, by.dictionary.power))
    if labels.effect is None:
        return replace(diagnosis, labels=labels)
    model = diagnosis.sensor
    others = tuple(effect for effect in model.effects if not isinstance(effect, LabelEffect))
    sensor = SensorModel(model.pattern, (*others, labels.effect), model.origin)
    return replace(diagnosis, labels=labels, sensor=sensor)


def _initially_free(context: Context) -> tuple[int, ...]:
    effects = context.initial_effects
    return tuple(index for index, effect in enumerate(effects) if effect.name in context.refitted)


def _catalogue(context: Context) -> set[str]:
    return {kind.name for kind in context.candidates} | {effect.name for effect in context.initial_effects}


def _rests(context: Context, model: FittedModel, findings: Sequence[ReportedTerm]) -> dict[str, Curve]:
    """What the data still differ by from each formula, by the name of its effect."""
    with_formula = [one for one in findings if one.unknown is not None and one.unknown.has_formula]
    if not with_formula:
        return {}
    linearisation, terms = linearise(model.fitter, model.fitted, model.frames), {t.group.name: t for t in model.terms}
    sample, sectors = model.fitter.sample, context.settings.selection.sectors
    covariates = {one.name: one for one in sample_covariates(sample, model.fitted.prediction, model.frames)}
    rests = {
        one.name: rest_of_curve(linearisation, terms[one.term], covariates, one.name, sectors) for one in with_formula
    }
    return {name: rest for name, rest in rests.items() if rest is not None}


def _wiring(exchanged: Sequence[Exchange]) -> tuple[Unexplained, ...]:
    """Exchanged lasers as one entry: the share of their returns that agree with another ring's trace."""
    if not exchanged:
        return ()
    return (Unexplained("wiring", ("ring",), float(np.mean([one.other for one in exchanged])), "", 0.0),)


def _unexplained(
    context: Context, model: FittedModel, phases: Sequence[Term], last: SelectionEvidence
) -> tuple[Unexplained, ...]:
    """Terms that no formula describes, and everything significant that is left beyond the accuracy of the fit."""
    of_phases = tuple(
        Unexplained(
            term.group.channel, term.group.covariates, float("nan"), "", term.p_value, term.group.effect_name
        )
        for term in phases
    )  # fmt: skip
    return (*of_phases, *remaining(last, model, context.settings))


def _ranking(first: SelectionEvidence) -> tuple[Alternative, ...]:
    """Effects about the initial model: twice the gain foreseen less its penalty (ΔBIC), and p."""
    each = float(np.log(len(first.linearisation.sample)))
    best: dict[str, Alternative] = {}
    for result in first.results:
        name = result.group.effect_name
        if name:
            row = Alternative(name, 2 * result.gain - each * result.group.size, result.p_value)
            if name not in best or row.delta_bic > best[name].delta_bic:
                best[name] = row
    return tuple(sorted(best.values(), key=lambda row: -row.delta_bic))


def _smallest(last: SelectionEvidence, settings: Settings) -> dict[str, dict[str, float]]:
    """Amplitude of each effect that would have been detected with 80 % power at the family-wise level."""
    needed = float(stats.norm.isf(settings.level / 2 / max(last.dictionary.tested, 1))) + settings.dictionary.power
    amplitudes_by_effect: dict[str, dict[str, float]] = {}
    for result in last.results:
        tangent, entry = result.group.tangent, result.entry
        if tangent is None or not tangent.amplitude or not np.any(entry.information > 0):
            continue
        total = float(entry.information.sum())
        amplitude = needed * float(np.sqrt(entry.variance.sum())) / max(total, 1e-300)
        amplitude *= abs(tangent.step) if result.group.direct is not None else 1.0
        row = amplitudes_by_effect.setdefault(tangent.effect.name, {})
        row[tangent.amplitude] = min(amplitude, row.get(tangent.amplitude, np.inf))
    return amplitudes_by_effect


def _spreads(on: FittedFrames) -> dict[str, float]:
    """Standard deviations of nuisance parameters, by name with unit."""
    random, estimate = on.fitter.random, on.fitted.estimate
    poses = random.spread(estimate, "poses")
    objects = [random.spread(estimate, name) for name in ("objects", "objects_by_scan")]
    spreads = {
        "pose_shift_m": float(np.sqrt(np.mean(poses[:3] ** 2))) if len(poses) else 0.0,
        "pose_turn_deg": float(np.degrees(np.sqrt(np.mean(poses[3:] ** 2)))) if len(poses) else 0.0,
        "object_shift_m": float(np.sqrt(sum(part[0] ** 2 for part in objects if len(part)))),
        "map_m": float(np.max(random.spread(estimate, "map"), initial=0.0)),
        "object_albedo": float(np.max(random.spread(estimate, "albedo"), initial=0.0)),
        "map_albedo": float(np.max(random.spread(estimate, "albedo_of_map"), initial=0.0)),
    }
    return {name: value for name, value in spreads.items() if value > 0}


def _notes(context: Context, on: FittedFrames) -> tuple[str, ...]:
    observed = [frame.observed for frame in on.frames]
    drive = context.tracer.drive
    of_drive = drive_notes(
        drive,
        frames=len(observed),
        bad=sum(frame.bad for frame in observed),
        unmatched=sum(frame.unmatched for frame in observed),
        has_intensity=on.fitter.sample.has_intensity,
    )
    of_fit = fit_notes(len(observed), context.split.is_held_out, has_surfels(drive.root), context.settings.beams)
    return (*of_drive, *of_fit)

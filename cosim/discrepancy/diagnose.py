"""Which physical effects a sensor model lacks: fit, screen, pick, accept, again; eliminate, confirm, end."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from cosim.discrepancy.budget import budget_of
from cosim.discrepancy.candidates import candidate_effects
from cosim.discrepancy.data.checks import check_fit, drive_notes, fit_notes, not_told, opened, struck_notes
from cosim.discrepancy.data.frames import FrameTracer
from cosim.discrepancy.data.split import split_drive, split_frames
from cosim.discrepancy.diagnosis import Alternative, Diagnosis, Finding
from cosim.discrepancy.eliminate import assured, confirmed, eliminated, redrawn, simplified
from cosim.discrepancy.inference.comparison import Gain, ToldBy, gain
from cosim.discrepancy.inference.intervals import intervals
from cosim.discrepancy.inference.score_test import Tested
from cosim.discrepancy.select import Candidate, as_found, candidates, chosen, roundings, screened, screened_pairs, tiers
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.discrepancy.state import Case, Model, State, View, fitted_anew, given, judged, seen_by, viewed
from cosim.discrepancy.unexplained import unexplained
from cosim.drives.kitti import Drive
from cosim.drives.twin.surfels import has_surfels
from cosim.labels.bias import Certainty, diagnose_labels
from sensors.effects.base import Effect
from sensors.effects.labels.box_shrink import BoxShrink
from sensors.effects.lasers import as_known
from sensors.sensor_model import SensorModel, load_sensor

_LOG = logging.getLogger(__name__)


def diagnose(
    drive: Drive | str | Path,
    sensor: SensorModel | str | Path,
    *,
    frames: Sequence[str] | None = None,
    extra: Sequence[type[Effect]] = (),
    seed: int = 0,
    settings: Settings = DEFAULT,
    along: Sequence[str] = (),
    on_progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Find the effects that a sensor model lacks against a drive.

    Args:
        drive: measured, with a twin, or its folder.
        sensor: the model, or its file.
        frames: those to use; all by default.
        extra: effects of the user's own to ask for beside the catalogue and the installed ones.
        seed: of samples and signs.
        settings: numbers that decide.
        along: names of the sensor's effects whose parameters are fitted anew along with whatever is found.
        on_progress: is told what is being done.

    Raises:
        CosimError: the drive lacks points or a twin, or the twin does not fit it.
        SensorError: the sensor file breaks the rules.
    """
    asked = opened(drive)
    case = case_of(
        asked, sensor, frames=frames, extra=extra, seed=seed, settings=settings, along=along,
        say=on_progress or _LOG.debug,
    )  # fmt: skip
    state = begun(case)
    before = None
    while state is not before and len(state.found) < settings.most_findings:
        before, state = state, added(case, state)
    state = confirmed(case, assured(case, redrawn(case, eliminated(case, simplified(case, state)))))
    return with_labels(concluded(case, state), asked)


def case_of(
    drive: Drive,
    sensor: SensorModel | str | Path,
    *,
    frames: Sequence[str] | None = None,
    extra: Sequence[type[Effect]] = (),
    seed: int = 0,
    settings: Settings = DEFAULT,
    along: Sequence[str] = (),
    say: Callable[[str], None] = _LOG.debug,
) -> Case:
    """What stays the same throughout a diagnosis; see `diagnose`."""
    model = sensor if isinstance(sensor, SensorModel) else load_sensor(sensor)
    split = (
        split_drive(drive, model.pattern.rings * model.pattern.firings, settings.sampling)
        if frames is None
        else split_frames(tuple(frames), settings=settings.sampling)
    )
    hidden = not_told(len(split.fit), has_surfels(drive.root), settings.beams)
    kinds = tuple(one for one in candidate_effects(extra, model.pattern.rings) if one.name not in hidden)
    return Case(model, FrameTracer(drive, model, settings), split, kinds, settings, seed, say, tuple(along))


def begun(case: Case) -> State:
    """Everything traced, and what is merely not known fitted."""
    case.say("tracing the twin")
    effects = given(case)
    model = Model(effects, tuple(place for place, one in enumerate(effects) if one.name in case.along))
    first = case.tracer.trace(case.split.fit[0], ())
    check_fit(first, case.tracer.drive)
    view = fitted_anew(case, model)
    model = replace(model, effects=view.fitted.effects)
    judges = view
    if case.split.is_held_out:
        judges = viewed(case, case.split.test, Model(model.effects), case.settings.judging_rows)
    return State(model, view, judges)


def added(case: Case, state: State) -> State:
    """With the first candidate that helps on frames that took no part; the same state, screened, if there is none."""
    case.say(f"looking for effects beyond {len(state.found)} found")
    for one in roundings(case, state):
        if one.name not in state.refused and not any(found.effect == one.name for found in state.found):
            after = accepted(case, state, one, ())
            if after is not None:
                return after
    tested = screened(case, state)
    sure = [one for one in tested if one.p_value <= case.settings.level]
    if not sure or not all(one.group.is_effect for one in sure):  # a dependence on one may be a part of one on two
        tested = sorted([*tested, *screened_pairs(case, state)], key=lambda one: (one.p_value, -one.value))
    state.screened[:] = tested
    refused = state.refused
    for some in tiers(case, state, tested):
        asked = replace(state, refused=refused)
        found = candidates(case, asked, some)
        state.ranking[:] = state.ranking or _ranking(found, tested)
        for one in islice(chosen(case, asked, some, found), case.settings.pick.tried):
            case.say(f"adding {one.name}")
            after = accepted(case, state, one, found)
            if after is not None:
                return replace(after, refused=refused)
            refused = refused | {one.name}
    return state


def accepted(case: Case, state: State, one: Candidate, found: Sequence[Candidate]) -> State | None:
    """With a candidate, everything fitted anew; None where frames that took no part deny it."""
    view = fitted_anew(case, one.model, replace(state.view, fitted=one.fitted))
    model = replace(one.model, effects=view.fitted.effects)
    judges = judged(case, state.judges, model)
    if not one.is_fact and case.split.is_held_out:
        told = gain_elsewhere(case, state, view, judges, one.told_by)
        case.say(f"{one.name} gains {told.value:.1f} ± {told.error:.1f} on frames that took no part")
        if told.p_value > case.settings.level:
            return None
    after = replace(state, model=model, view=view, judges=judges, screened=[])
    return after.with_found(as_found(case, state, one, found))


def gain_elsewhere(case: Case, state: State, view: View, judges: View, by: ToldBy) -> Gain:
    """What a model gains where it was not fitted.

    On frames that took no part. Of a map made of the scans these are few, next to each other, and say little of how
    surfaces look from near and far. There all frames judge, by surfaces in places that took no part: whose own places
    are free as those of the others are. Such places are few, and one wall may gain more than all others together: so it
    is asked, too, how sure the gain is without the most of that.

    Args:
        case: of the diagnosis.
        state: before.
        view, judges: frames that are fitted, and that judge, as the model tells them.
        by: what tells of the candidate.
    """
    same = judges.fitter is state.judges.fitter
    if view.fitter.sample.of_own_map:
        frozen, frames = Model(view.fitted.effects), (*view.frames, *judges.frames)
        names = (*view.names, *judges.names)
        judges, same = viewed(case, names, frozen, case.settings.judging_rows, traced=frames, judging=True), False
    before = state.judges.fitted if same else seen_by(judges, state.model.effects)
    told = gain(judges.fitter, before, judges.fitted, by)
    if not view.fitter.sample.of_own_map:
        return told
    return min(told, told.without_outlier(), key=lambda one: one.p_value)


def concluded(case: Case, state: State) -> Diagnosis:
    """The whole screen once more, errors and their budget, and everything in its last values."""
    tested = state.screened
    if not tested:
        case.say("looking at what is left")
        tested = [*screened(case, state), *screened_pairs(case, state)]
    case.say("measuring errors on frames that took no part")
    told = intervals(state.view.fitter, state.view.fitted) if state.view.fitted.free else {}
    budget, judged = budget_of(case, state.judges, _steps(case, state))
    findings, unknowns = [], []
    for number, one in enumerate(state.found):
        place = state.model.place_of(one.effect)
        if place is None:
            continue
        params = state.model.effects[place].model_dump(mode="json")
        ci95 = told.get(one.effect, one.interval or {})
        if one.shape is not None:
            unknowns.append(replace(one.shape, p_value=one.p_value).refitted(params, ci95))
            continue
        before, after = budget.steps[number], budget.steps[number + 1]
        alike = tuple(name for name in one.also_possible if state.model.place_of(name) is None)
        findings.append(Finding(one.effect, params, ci95, one.p_value, before, after, alike))
    return Diagnosis(
        effects=tuple(findings),
        ranking=tuple(Alternative(*row) for row in state.ranking),
        unknowns=tuple(unknowns),
        unexplained=unexplained(tested, state.view.fitted, case.settings),
        smallest_detectable=_smallest(tested, case),
        budget=budget,
        sensor=SensorModel(case.sensor.pattern, as_known(state.model.effects), case.sensor.origin),
        split=case.split,
        spreads=_spreads(state),
        notes=_notes(case, state),
        judged=judged,
        settings=case.settings,
        refitted={
            one.name: {"params": one.model_dump(mode="json"), "ci95": told.get(one.name, {})}
            for one in state.model.effects[: len(given(case))]
            if one.name in case.along
        },
    )


def with_labels(found: Diagnosis, drive: Drive) -> Diagnosis:
    """A diagnosis with its labels looked at; a missing label effect goes into the improved sensor.

    The verdict stays that of the points, unless these lack nothing.
    """
    if not any(drive[name].has("label_2") for name in drive.frames):
        return found
    by = found.settings
    labels = diagnose_labels(drive, found.sensor, certainty=Certainty(by.level, by.coverage, by.screen.power))
    if labels.effect is None:
        return replace(found, labels=labels)
    model = found.sensor
    others = tuple(one for one in model.effects if not isinstance(one, BoxShrink))
    sensor = SensorModel(model.pattern, (*others, labels.effect), model.origin)
    return replace(found, labels=labels, sensor=sensor)


def _steps(case: Case, state: State) -> list[tuple[Effect, ...]]:
    """The model after each finding, as it would be with the last values of those found so far."""
    effects = state.model.effects
    own = tuple(effects[place] if one.name in case.along else one for place, one in enumerate(given(case)))
    models = [own]
    there: set[str] = set()
    for one in state.found:
        there.add(one.effect)
        known = [
            effect if place >= len(own) or effect.name in there else own[place] for place, effect in enumerate(effects)
        ]
        models.append(tuple(e for place, e in enumerate(known) if place < len(own) or e.name in there))
    return models


def _ranking(found: Sequence[Candidate], tested: Sequence[Tested]) -> list[tuple[str, float, float]]:
    """Candidates of the first round: name, twice the gain less its price (ΔBIC), and p."""
    each = float(np.log(len(found[0].fitted.residuals.loglik))) if found else 0.0
    rows = [(one.name, 2 * one.gain.value - one.numbers * each, one.p_value) for one in found]
    there = {name for name, *_ in rows}
    for one in tested:
        if one.group.is_effect and one.group.name not in there:
            there.add(one.group.name)
            rows.append((one.group.name, 2 * one.gain - one.group.size * each if found else 0.0, one.p_value))
    return [(name, float(value), float(p)) for name, value, p in sorted(rows, key=lambda row: -row[1])]


def _smallest(tested: Sequence[Tested], case: Case) -> dict[str, dict[str, float]]:
    """Amplitude of each effect that would have been found with 80 % power."""
    found: dict[str, dict[str, float]] = {}
    for one in tested:
        if one.group.is_effect and one.group.amplitude and np.isfinite(one.smallest):
            mine = found.setdefault(one.group.name, {})
            mine[one.group.amplitude] = min(one.smallest, mine.get(one.group.amplitude, np.inf))
    return found


def _spreads(state: State) -> dict[str, float]:
    """Standard deviations of what is merely not known, by name with its unit."""
    random, estimate = state.view.fitter.random, state.view.fitted.estimate
    poses = random.spread(estimate, "poses")
    objects = [random.spread(estimate, name) for name in ("objects", "objects_by_scan")]
    found = {
        "pose_shift_m": float(np.sqrt(np.mean(poses[:3] ** 2))) if len(poses) else 0.0,
        "pose_turn_deg": float(np.degrees(np.sqrt(np.mean(poses[3:] ** 2)))) if len(poses) else 0.0,
        "object_shift_m": float(np.sqrt(sum(one[0] ** 2 for one in objects if len(one)))),
        "map_m": float(np.max(random.spread(estimate, "map"), initial=0.0)),
        "object_albedo": float(np.max(random.spread(estimate, "albedo"), initial=0.0)),
        "map_albedo": float(np.max(random.spread(estimate, "albedo_of_map"), initial=0.0)),
    }
    return {name: value for name, value in found.items() if value > 0}


def _notes(case: Case, state: State) -> tuple[str, ...]:
    seen = [frame.observed for frame in state.view.frames]
    of_drive = drive_notes(
        case.tracer.drive,
        frames=len(seen),
        bad=sum(one.bad for one in seen),
        strays=sum(one.strays for one in seen),
        has_intensity=state.view.fitter.sample.has_intensity,
    )
    of_fit = fit_notes(len(seen), case.split.is_held_out, has_surfels(case.tracer.drive.root), case.settings.beams)
    return (*of_drive, *of_fit, *struck_notes([one.effect for one in state.struck]))

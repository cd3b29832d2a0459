"""Which physical effects a sensor model lacks: gate, rank, add, refit, until nothing more is there."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.discrepancy.checks import check_fit, opened
from cosim.discrepancy.diagnosis import Alternative, Diagnosis, Finding
from cosim.discrepancy.directions import directions
from cosim.discrepancy.fitting import Fitted, Fitter, Free, all_free
from cosim.discrepancy.frames import FrameTracer, TracedFrame, bending, in_order
from cosim.discrepancy.gate import LEVEL, Verdict, run_gate
from cosim.discrepancy.held_out import Split, split_drive
from cosim.discrepancy.intervals import intervals
from cosim.discrepancy.kinds import as_known, candidate_kinds, with_rings
from cosim.discrepancy.label_scatter import with_unsure_labels
from cosim.discrepancy.labels import with_labels
from cosim.discrepancy.lattice import Lattice, find_lattices
from cosim.discrepancy.pose_patterns import PosePatterns
from cosim.discrepancy.ranking import Ranked, fit_candidate, judged_anew, look_alikes, shortlist, simpler_first
from cosim.discrepancy.revising import is_idle, redrawn, simpler_rival
from cosim.discrepancy.sample import Sample, draw_sample
from cosim.discrepancy.settling import Settled, settle
from cosim.discrepancy.taken_up import handed_over
from cosim.discrepancy.testing import HeldOut, held_out_errors
from cosim.discrepancy.unknown import (
    Shape,
    effect_name,
    find_shape,
    rank_shape,
    shape_effect,
    shape_gate,
    spread_of_gain,
)
from cosim.kitti import Drive
from sensors.effects.base import BeamEffect, Effect, RoundingEffect
from sensors.sensor_model import SensorModel, load_sensor

_LOG = logging.getLogger(__name__)
_QUICK_ROWS = 20_000
_COARSE_M = 0.25
_FEWEST_PARTS = 120
_MOST_EFFECTS = 12
_ALIKE_BIC = 10.0
_LEAST_BIC = 0.0
_CLEARLY_THERE = 5.0
_CLEARLY_MORE = 1.15  # times the gain of the best candidate must be an unknown shape's
_SHAPE_LEVEL = 0.02
_WIDELY = 3.0  # deviates by which an unknown shape must gain from place to place
_RETUNED_SIGMAS, _RETUNED_SHARE = 2.0, 1e-3  # what other values of an effect must gain, of its scatter and of the error
_HARM_SIGMAS = 2.0
_TRIED = 3  # candidates a round, until one helps on held-out frames; then those that the gate lets through alone


@dataclass(frozen=True)
class _Model:
    """The sensor as it stands: its effects, and which of them have been fitted here."""

    effects: tuple[Effect, ...]
    fitted: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class _Look:
    """The model fitted once more, and whether anything is missing still."""

    fitter: Fitter
    fitted: Fitted
    lattices: Sequence[Lattice]
    verdict: Verdict


@dataclass(frozen=True, eq=False)
class _Choice:
    """What could be added: a candidate, or a shape that no candidate has."""

    ranked: Ranked
    rivals: tuple[Ranked, ...] = ()
    shape: Shape | None = None


def diagnose(
    drive: Drive | str | Path,
    sensor: SensorModel | str | Path,
    *,
    extra: Sequence[type[Effect]] = (),
    seed: int = 0,
    on_progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Find the effects that a sensor model lacks against a drive.

    Args:
        drive: measured, with a twin, or its folder.
        sensor: the model, or its file.
        extra: effects of the user's own to ask for beside the catalogue and the installed ones.
        seed: of samples and signs.
        on_progress: is told what is being done.

    Raises:
        CosimError: the drive lacks points or a twin, or the twin does not fit it.
        SensorError: the sensor file breaks the rules.
    """
    detective = Detective(opened(drive), sensor, extra, seed, on_progress or _LOG.debug)
    return with_labels(detective.run(), detective.drive)


class Detective:
    """One diagnosis; see `diagnose`."""

    def __init__(
        self,
        drive: Drive,
        sensor: SensorModel | str | Path,
        extra: Sequence[type[Effect]],
        seed: int,
        say: Callable[[str], None],
    ) -> None:
        self.drive = drive
        self.sensor = sensor if isinstance(sensor, SensorModel) else load_sensor(sensor)
        self.split: Split = split_drive(drive)
        self._kinds = candidate_kinds(extra, self.sensor.pattern.rings)
        self._seed, self._say = seed, say
        self._tracer = FrameTracer(drive, self.sensor)
        self._frames: list[TracedFrame] = []
        self._given = with_rings(in_order(self.sensor.effects), self.sensor.pattern.rings)
        self._model = _Model(self._given)
        self._findings: list[Finding] = []
        self._ranking: list[Alternative] = []
        self._unknown: Shape | None = None
        self._errors: list[HeldOut] = []
        self._refused: set[str] = set()

    def run(self) -> Diagnosis:
        """Everything in order."""
        self._trace()
        check_fit(self._frames[0], self.drive)
        self._errors.append(self._held_out())
        look = self._look(self._fitted_anew())
        while len(self._errors) <= _MOST_EFFECTS and (added := self._added(look)) is not None:
            look = self._look(added)
        return self._concluded(self._tidied(self._revised(look)))

    def _look(self, settled: Settled) -> _Look:
        """Run the gate over what a fit leaves."""
        self._say(f"looking for effects beyond {len(self._findings)} found")
        fitter, fitted = settled.fitter, settled.fitted
        lattices = find_lattices(fitter, fitted, self._kinds, np.random.default_rng([self._seed, 3]))
        return _Look(fitter, fitted, lattices, self._gate(fitter, fitted, lattices))

    def _added(self, look: _Look) -> Settled | None:
        """The first choice that helps, with everything fitted anew; None if there is none."""
        found = (self._adopt(choice, look) for choice in self._choices(look))
        return next((one for one in found if one is not None), None)

    def _choices(self, look: _Look) -> Iterator[_Choice]:
        """What to add, the most promising first."""
        ranked = self._rank(look) if look.verdict.p_value <= LEVEL else []
        self._ranking = self._ranking or [_alternative(one, look.verdict) for one in ranked]
        worthy = [one for one in ranked if one.delta_bic > _LEAST_BIC]
        strange = self._strange(look, worthy[0] if worthy else None) if self._unknown is None else None
        if strange is not None:
            yield strange
        # What did not help before waits until all others have been tried.
        waiting = sorted(worthy, key=lambda one: one.effect in self._refused)
        outstanding = [one for one in waiting[_TRIED:] if _p_value(look.verdict, one.effect) <= LEVEL]
        for one in (*waiting[:_TRIED], *outstanding):
            yield _Choice(one, tuple(other for other in worthy if other is not one))

    def _adopt(self, choice: _Choice, look: _Look) -> Settled | None:
        """Add a choice, if frames that took no part in the fit are told better with it."""
        best, before = choice.ranked, (self._model, self._frames)
        self._say(f"adding {best.effect}")
        places = self._model.fitted if best.place in self._model.fitted else (*self._model.fitted, best.place)
        is_new = best.place >= len(self._model.effects)
        self._model = _Model(best.fitted.effects, places)
        if isinstance(best.fitted.effects[best.place], BeamEffect):
            self._frames = self._traced(bending(self._model.effects), best.fitted.pose)
        settled, after = self._fitted_anew(best.fitted.pose), self._held_out()
        if not _helps(best, after, self._errors[-1], is_new):
            self._say(f"{best.effect} does not help on frames that took no part: taken back")
            self._model, self._frames = before
            self._refused.add(best.effect)
            return None
        self._errors.append(after)
        if choice.shape is not None:
            self._unknown = choice.shape
            return self._parted(choice.shape) if choice.shape.has_apart else settled
        alike = tuple(one.effect for one in choice.rivals if one.delta_bic > best.delta_bic - _ALIKE_BIC)
        p_value, known = look.verdict.p_value, {one.effect.name: one.interval for one in look.lattices}
        interval = known.get(best.effect, {})
        self._findings.append(
            Finding(best.effect, {}, interval, p_value, self._errors[-2], after, alike, best.delta_bic)
        )
        return settled

    def _parted(self, shape: Shape) -> Settled:
        """The unknown shape about zero: a constant error beside it is a candidate of the next round."""
        place, self._unknown = self._unknown_place(), shape.without_level()
        assert place is not None  # it has just been added
        self._model = replace(self._model, effects=self._with(place, shape_effect(self._unknown)))
        settled = self._fitted_anew()
        self._errors[-1] = self._held_out()
        return settled

    def _revised(self, look: _Look) -> _Look:
        """What was found first, looked at again beside all the rest."""
        if len(self._findings) + (self._unknown is not None) < 2:
            return look
        for number, finding in enumerate(self._findings):
            place = next(i for i, effect in enumerate(self._model.effects) if effect.name == finding.effect)
            rival = simpler_rival(look.fitter, look.fitted, place, self._kinds)
            anew = self._exchanged(look, place, rival) if rival is not None else None
            if rival is not None and anew is not None:
                look, self._findings[number] = anew, replace(finding, effect=rival.name)
        place = self._unknown_place()
        if self._unknown is None or place is None:
            return look
        shape = redrawn(look.fitter, look.fitted, place, self._unknown)
        if shape is None or shape.is_like(self._unknown):
            self._unknown = shape or self._unknown
            return look
        anew = self._exchanged(look, place, shape_effect(shape))
        self._unknown = shape if anew is not None else self._unknown
        return anew or look

    def _with(self, place: int, effect: Effect) -> tuple[Effect, ...]:
        return (*self._model.effects[:place], effect, *self._model.effects[place + 1 :])

    def _exchanged(self, look: _Look, place: int, effect: Effect) -> _Look | None:
        """With another effect in a place, unless frames that took no part are told worse by it."""
        self._say(f"{effect.name} in place of {self._model.effects[place].name}")
        before = self._model, self._frames
        self._model = replace(self._model, effects=self._with(place, effect))
        settled, after = self._fitted_anew(), self._held_out()
        if self._errors[-1].beats(after):
            self._model, self._frames = before
            return None
        self._errors[-1] = after
        return replace(look, fitter=settled.fitter, fitted=settled.fitted)

    def _tidied(self, look: _Look) -> _Look:
        """Take out, or put back as it was said, what turned out to do nothing once the others were there."""
        fitter, fitted = look.fitter, look.fitted
        idle = [
            place
            for place in self._model.fitted
            if is_idle(fitter, fitted, place, _CLEARLY_THERE, said=self._said(place))
        ]
        if not idle:
            return look
        self._say(f"taking out {', '.join(self._model.effects[place].name for place in idle)}")
        gone = {self._model.effects[place].name for place in idle}
        self._findings = [one for one in self._findings if one.effect not in gone]
        effects = {place: effect for place, effect in enumerate(self._model.effects) if place not in idle}
        effects |= {place: said for place in idle if (said := self._said(place)) is not None}
        kept = sorted(effects)
        places = tuple(kept.index(place) for place in self._model.fitted if place not in idle)
        self._model = _Model(tuple(effects[place] for place in kept), places)
        settled = self._fitted_anew()
        self._errors.append(self._held_out())
        return replace(look, fitter=settled.fitter, fitted=settled.fitted)

    def _concluded(self, look: _Look) -> Diagnosis:
        return Diagnosis.of(
            sensor=SensorModel(self.sensor.pattern, as_known(self._model.effects), self.sensor.origin),
            findings=self._settled(look),
            ranking=self._ranking,
            verdict=look.verdict,
            errors=self._errors,
            split=self.split,
            unknown=self._shape(look),
        )

    def _shape(self, look: _Look) -> Shape | None:
        """The unknown shape as it was fitted at last."""
        place = self._unknown_place()
        if self._unknown is None or place is None:
            return None
        told = intervals(look.fitter, look.fitted).get(effect_name(self._unknown), {})
        return self._unknown.refitted(self._model.effects[place].model_dump(), told)

    def _unknown_place(self) -> int | None:
        """Where the unknown shape stands among the effects."""
        name = effect_name(self._unknown) if self._unknown is not None else ""
        return next((place for place, effect in enumerate(self._model.effects) if effect.name == name), None)

    def _held_out(self) -> HeldOut:
        return held_out_errors(self._tracer, self.split.test, self._model.effects, self.sensor.origin)

    def _trace(self) -> None:
        self._say("tracing the twin")
        self._frames = self._traced(bending(self._model.effects))

    def _traced(self, bending: tuple[Effect, ...], leaning: np.ndarray | None = None) -> list[TracedFrame]:
        frames = self._tracer.trace_all(self.split.fit, bending, leaning)
        return with_unsure_labels(frames, self._frames[0].label_scatter_m) if self._frames else frames

    def _sample(self, rows: int) -> Sample:
        return draw_sample(self._frames, rows, np.random.default_rng([self._seed, rows]))

    def _free(self) -> tuple[Free, ...]:
        return all_free(self._model.effects, self._model.fitted, self.sensor.pattern.rings)

    def _gate(self, fitter: Fitter, fitted: Fitted, lattices: Sequence[Lattice]) -> Verdict:
        found = [
            *directions(fitter, fitted, self._kinds, self._model.fitted),
            *(one.direction() for one in lattices),
        ]
        sample = fitter.sample
        views = (0.0, _COARSE_M)
        evidence = [fitter.evidence(fitted.prediction, fitted.pose, blur) for blur in views]
        raw = [fitter.evidence(fitted.prediction, None, blur) for blur in views]
        rng = np.random.default_rng([self._seed, 1])
        return run_gate(
            found,
            evidence,
            raw,
            sample.track,
            sample.frame,
            sample.parts(_FEWEST_PARTS),
            fitted.columns,
            fitter.pose_errors.slopes(fitted.pose),
            rng,
            PosePatterns(fitter, fitted).of(found, np.random.default_rng([self._seed, 4])),
        )

    def _rank(self, look: _Look) -> list[Ranked]:
        """Candidates by how much the BIC falls with them."""
        fitter = Fitter(self._sample(_QUICK_ROWS))
        null = fitter.fit(self._model.effects, (), pose=look.fitted.pose, pose_sigma=look.fitted.pose_sigma)
        found = directions(fitter, null, self._kinds, self._model.fitted)
        promising = shortlist(fitter, null, found, look.verdict)
        self._say(f"fitting {', '.join(promising)}")
        ranked = [fit_candidate(fitter, null, starts, self._model.fitted) for starts in promising.values()]
        alike = shortlist(fitter, null, look_alikes(ranked, found, self._kinds), look.verdict)
        ranked += [fit_candidate(fitter, null, starts, self._model.fitted) for starts in alike.values()]
        promising |= alike
        of_effect = {name: [one for one in found if one.effect == name] for name in promising}
        ranked = handed_over(ranked, fitter, null, of_effect, self._traced, self._model.fitted)
        ranked.sort(key=lambda one: -one.delta_bic)
        ranked = simpler_first(judged_anew(ranked, fitter, null, self._traced), fitter, promising)
        ranked += [one.ranked(look.fitter, look.fitted) for one in look.lattices]
        return sorted(ranked, key=lambda one: -one.delta_bic)

    def _strange(self, look: _Look, best: Ranked | None) -> _Choice | None:
        """A dependence that explains clearly more than the best candidate, or that is there when none is."""
        fitted = look.fitted
        shape = find_shape(look.fitter, fitted)
        if shape is None:
            return None
        if best is None:
            rng = np.random.default_rng([self._seed, 2])
            if shape_gate(look.fitter, fitted, fitted.columns, rng).p_value > _SHAPE_LEVEL:
                return None
        quick = Fitter(self._sample(_QUICK_ROWS))
        null = quick.fit(fitted.effects, (), pose=fitted.pose, pose_sigma=fitted.pose_sigma)
        shape, found = rank_shape(quick, null, shape, self._model.fitted)
        known = best.delta_bic if best is not None else 0.0
        clear = found.delta_bic > _CLEARLY_MORE * known + _ALIKE_BIC
        widely = spread_of_gain(quick, null, found.fitted) > _WIDELY
        return _Choice(found, shape=shape) if clear and widely else None

    def _fitted_anew(self, pose: np.ndarray | None = None) -> Settled:
        """The model fitted to frames traced as it bends their beams, starting from pose errors."""
        found = settle(self._frames, self._traced, self._model.effects, self._free(), self._seed, pose)
        self._frames, self._model = found.frames, replace(self._model, effects=found.fitted.effects)
        return found

    def _said(self, place: int) -> Effect | None:
        """The effect as the sensor had it; None if it did not."""
        return self._given[place] if place < len(self._given) else None

    def _settled(self, look: _Look) -> list[Finding]:
        """Findings with the parameters and intervals of the last joint fit."""
        fitted = look.fitted
        found = intervals(look.fitter, fitted) if fitted.free else {}
        effects = {effect.name: effect for effect in fitted.effects}
        done = []
        for finding in self._findings:
            params = effects[finding.effect].model_dump(mode="json")
            done.append(finding.settled(params, found.get(finding.effect, finding.ci95)))
        return done


def _helps(best: Ranked, after: HeldOut, before: HeldOut, is_new: bool) -> bool:
    """Whether an addition may stand by what held-out frames say.

    A lattice is a fact of the file, which needs only do no harm; so is where points stand beside their beams. Other
    values of an effect that was there take more than what is new: what they fit may be any misfit of that channel.
    """
    if isinstance(best.fitted.effects[best.place], RoundingEffect):
        return not before.beats(after, share=_RETUNED_SHARE)
    if after.aligns(before) and not before.beats(after, _HARM_SIGMAS):
        return True
    return after.beats(before) if is_new else after.beats(before, _RETUNED_SIGMAS, _RETUNED_SHARE)


def _p_value(verdict: Verdict, effect: str) -> float:
    return min((one.p_value for one in verdict.statistics if one.direction.effect == effect), default=1.0)


def _alternative(ranked: Ranked, verdict: Verdict) -> Alternative:
    return Alternative(ranked.effect, ranked.delta_bic, _p_value(verdict, ranked.effect))

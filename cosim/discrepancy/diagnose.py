"""Which physical effects a sensor model lacks: gate, rank, add, refit, until nothing more is there."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.discrepancy.data.checks import check_fit, opened
from cosim.discrepancy.data.frames import bending
from cosim.discrepancy.data.notes import drive_notes, fit_notes
from cosim.discrepancy.diagnosis import Alternative, Diagnosis, Finding
from cosim.discrepancy.gate import Direction, Verdict, run_gate
from cosim.discrepancy.groups.effects import directions
from cosim.discrepancy.groups.quantization import Lattice, find_lattices
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.intervals import intervals
from cosim.discrepancy.inference.wild_bootstrap import LEVEL
from cosim.discrepancy.inquiry import Inquiry, Look, Model
from cosim.discrepancy.kinds import as_known
from cosim.discrepancy.labels import with_labels
from cosim.discrepancy.map_errors import unsure_map
from cosim.discrepancy.pose_patterns import FEWEST_SCANS, PosePatterns
from cosim.discrepancy.ranking import (
    ALIKE_BIC,
    Ranked,
    fit_candidate,
    judged_anew,
    look_alikes,
    shortlist,
    simpler_first,
)
from cosim.discrepancy.revising import with_its_curve
from cosim.discrepancy.second_thoughts import parted, revised, tidied
from cosim.discrepancy.settling import Settled
from cosim.discrepancy.taken_up import handed_over
from cosim.discrepancy.twin_scatter import with_scatter
from cosim.discrepancy.unknown import (
    Shape,
    effect_name,
    find_shape,
    rank_shape,
    shape_gate,
    spread_of_gain,
)
from cosim.discrepancy.validation import HeldOut
from cosim.drives.kitti import Drive
from sensors.effects.base import BeamEffect, Effect, NoiseEffect, RoundingEffect
from sensors.sensor_model import SensorModel

_LOG = logging.getLogger(__name__)
_QUICK_ROWS = 20_000
_COARSE_M = 0.25
_MOST_EFFECTS = 12
_LEAST_BIC = 0.0
_CLEARLY_MORE = 1.15  # times the gain of the best candidate must be an unknown shape's
_SHAPE_LEVEL = 0.02
_WIDELY = 3.0  # deviates by which an unknown shape must gain from place to place
_RETUNED_SIGMAS, _RETUNED_SHARE = 2.0, 1e-3  # what other values of an effect must gain, of its scatter and of the error
_HARM_SIGMAS = 2.0
_CALIBRATED_SHARE = 0.01
_VARIANCES = {"range_variance", "intensity_variance"}
_TRIED = 3  # candidates a round, until one helps on held-out frames; then those that the gate lets through alone


@dataclass(frozen=True, eq=False)
class _Choice:
    """What could be added: a candidate, or a shape that no candidate has; last of all one that explains little more."""

    ranked: Ranked
    rivals: tuple[Ranked, ...] = ()
    shape: Shape | None = None
    is_last: bool = False


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
    asked = opened(drive)
    return with_labels(Detective(asked, sensor, extra, seed, on_progress or _LOG.debug).run(), asked)


class Detective(Inquiry):
    """One diagnosis; see `diagnose`."""

    def run(self) -> Diagnosis:
        """Everything in order."""
        self.trace()
        check_fit(self.frames[0], self.drive)
        self.errors.append(self.held_out())
        look = self._look(self.fitted_anew())
        while len(self.errors) <= _MOST_EFFECTS and (added := self._added(look)) is not None:
            look = self._look(added)
        return self._concluded(tidied(self, revised(self, look)))

    def _look(self, settled: Settled) -> Look:
        """Run the gate over what a fit leaves."""
        self.say(f"looking for effects beyond {len(self.findings)} found")
        fitter, fitted = settled.fitter, settled.fitted
        lattices = find_lattices(fitter, fitted, self.kinds, np.random.default_rng([self.seed, 3]))
        return Look(fitter, fitted, lattices, self._gate(fitter, fitted, lattices))

    def _added(self, look: Look) -> Settled | None:
        """The first choice that helps, with everything fitted anew; None if there is none."""
        quick = Fitter(self.sample(_QUICK_ROWS))
        null = quick.fit(look.fitted.effects, (), pose=look.fitted.pose, pose_sigma=look.fitted.pose_sigma)
        ranked = self._rank(look, quick, null) if look.verdict.p_value <= LEVEL else []
        worthy = [one for one in ranked if _is_worthy(one, look)]
        best = worthy[0] if worthy else None
        strange = self._strange(look, quick, null, best) if self.unknown is None else None
        explained = max((one.delta_bic for one in (best, strange and strange.ranked) if one), default=None)
        unsure = None if explained is None else self._unsure(look, quick, null, explained)
        if unsure is not None:
            return unsure
        self.ranking = self.ranking or [_alternative(one, look.verdict) for one in ranked]
        found = (self._adopt(choice, look) for choice in self._choices(look, worthy, strange))
        return next((one for one in found if one is not None), None)

    def _unsure(self, look: Look, quick: Fitter, null: Fitted, explained: float) -> Settled | None:
        """The model fitted anew with a map that may be off, if that explains more than anything else; once."""
        if self.found_map_off:
            return None
        scatter = unsure_map(self.frames, look.fitter, look.fitted, quick, null, explained)
        if scatter is None:
            return None
        self.found_map_off = True
        self.say(f"the map is off, by about {100 * scatter.map_m:.1f} cm")
        self.frames = with_scatter(self.frames, scatter)
        return self.fitted_anew(look.fitted.pose)

    def _choices(self, look: Look, worthy: Sequence[Ranked], strange: _Choice | None) -> Iterator[_Choice]:
        """What to add, the most promising first."""
        if strange is not None and not strange.is_last:
            yield strange
        # What did not help before waits until all others have been tried; where a twin is not sure of itself, so does
        # what is not significant by itself.
        unsure = look.fitter.sample.map_is_unsure
        chance = {one.effect: unsure and _p_value(look.verdict, one.effect) > LEVEL for one in worthy}
        waiting = sorted(worthy, key=lambda one: (one.effect in self.refused, chance[one.effect]))
        outstanding = [one for one in waiting[_TRIED:] if _p_value(look.verdict, one.effect) <= LEVEL]
        for one in (*waiting[:_TRIED], *outstanding):
            yield _Choice(one, tuple(other for other in worthy if other is not one))
        if strange is not None and strange.is_last and self._depends(look):
            yield strange

    def _adopt(self, choice: _Choice, look: Look) -> Settled | None:
        """Add a choice, if frames that took no part in the fit are told better with it."""
        best, before = choice.ranked, (self.model, self.frames)
        self.say(f"adding {best.effect}")
        places = self.model.fitted if best.place in self.model.fitted else (*self.model.fitted, best.place)
        is_new = best.place >= len(self.model.effects)
        self.model = Model(best.fitted.effects, places)
        if isinstance(best.fitted.effects[best.place], BeamEffect):
            self.frames = self.traced(bending(self.model.effects), best.fitted.pose)
        settled, after = self.fitted_anew(best.fitted.pose), self.held_out()
        if not _helps(best, after, self.errors[-1], is_new):
            self.say(f"{best.effect} does not help on frames that took no part: taken back")
            self.model, self.frames = before
            self.refused.add(best.effect)
            return None
        self.errors.append(after)
        if choice.shape is not None:
            self.unknown = choice.shape
            return parted(self, choice.shape) if choice.shape.has_apart else settled
        rivals = (one for one in choice.rivals if one.effect not in self.refused)
        alike = tuple(one.effect for one in rivals if best.is_like(one))
        p_value, known = look.verdict.p_value, {one.effect.name: one.interval for one in look.lattices}
        interval = known.get(best.effect, {})
        self.findings.append(Finding(best.effect, {}, interval, p_value, self.errors[-2], after, alike, best.delta_bic))
        return settled

    def _concluded(self, look: Look) -> Diagnosis:
        return Diagnosis.of(
            sensor=SensorModel(self.sensor.pattern, as_known(self.model.effects), self.sensor.origin),
            findings=self._settled(look),
            ranking=self.ranking,
            verdict=look.verdict,
            errors=self.errors,
            split=self.split,
            unknown=self._shape(look),
            map_off_m=self.frames[0].scatter.map_m,
            notes=self._notes(look),
        )

    def _notes(self, look: Look) -> tuple[str, ...]:
        seen, fitted = [frame.observed for frame in self.frames], len(self.frames)
        of_drive = drive_notes(
            self.drive,
            frames=fitted,
            bad=sum(one.bad for one in seen),
            strays=sum(one.strays for one in seen),
            has_intensity=look.fitter.sample.has_intensity,
        )
        return (*of_drive, *fit_notes(fitted, self.split.is_held_out))

    def _shape(self, look: Look) -> Shape | None:
        """The unknown shape as it was fitted at last."""
        place = self.unknown_place()
        if self.unknown is None or place is None:
            return None
        told = intervals(look.fitter, look.fitted).get(effect_name(self.unknown), {})
        drawn = with_its_curve(look.fitter, look.fitted, place, self.unknown)
        return drawn.refitted(self.model.effects[place].model_dump(), told)

    def _gate(self, fitter: Fitter, fitted: Fitted, lattices: Sequence[Lattice]) -> Verdict:
        found = [
            *directions(fitter, fitted, self.kinds, self.model.fitted),
            *(one.direction() for one in lattices),
        ]
        sample = fitter.sample
        views = (0.0, _COARSE_M)
        evidence = [fitter.evidence(fitted.prediction, fitted.pose, blur) for blur in views]
        raw = [fitter.evidence(fitted.prediction, None, blur) for blur in views]
        rng = np.random.default_rng([self.seed, 1])
        patterns = PosePatterns(fitter, fitted)
        verdict = run_gate(
            found,
            evidence,
            raw,
            sample.clusters,
            fitted.columns,
            fitter.slopes(fitted.pose, fitted.prediction),
            rng,
            patterns.of(found, np.random.default_rng([self.seed, 4])),
        )
        # Of few scans nobody knows whether they are off, or their poses.
        return verdict if len(sample.names) >= FEWEST_SCANS else verdict.unclaimed(patterns.rigid(found))

    def _rank(self, look: Look, fitter: Fitter, null: Fitted) -> list[Ranked]:
        """Candidates by how much the BIC falls with them."""
        found = directions(fitter, null, self.kinds, self.model.fitted)
        found = [one for one in found if _is_own(one, look.verdict)]
        promising = shortlist(fitter, null, found, look.verdict)
        self.say(f"fitting {', '.join(promising)}")
        ranked = [fit_candidate(fitter, null, starts, self.model.fitted) for starts in promising.values()]
        alike = shortlist(fitter, null, look_alikes(ranked, found, self.kinds), look.verdict)
        ranked += [fit_candidate(fitter, null, starts, self.model.fitted) for starts in alike.values()]
        promising |= alike
        of_effect = {name: [one for one in found if one.effect == name] for name in promising}
        ranked = handed_over(ranked, fitter, null, of_effect, self.traced, self.model.fitted)
        ranked.sort(key=lambda one: -one.delta_bic)
        ranked = simpler_first(judged_anew(ranked, fitter, null, self.traced), fitter, promising)
        ranked += [one.ranked(look.fitter, look.fitted) for one in look.lattices]
        return sorted(ranked, key=lambda one: -one.delta_bic)

    def _strange(self, look: Look, quick: Fitter, null: Fitted, best: Ranked | None) -> _Choice | None:
        """A dependence that explains more than the best candidate, or that is there when none is."""
        fitted = look.fitted
        shape = find_shape(look.fitter, fitted)
        if shape is None:
            return None
        if best is None and not self._depends(look):
            return None
        shape, found = rank_shape(quick, null, shape, self.model.fitted)
        known = best.delta_bic if best is not None else 0.0
        if found.delta_bic < known + ALIKE_BIC or spread_of_gain(quick, null, found.fitted) < _WIDELY:
            return None
        return _Choice(found, shape=shape, is_last=found.delta_bic < _CLEARLY_MORE * known + ALIKE_BIC)

    def _depends(self, look: Look) -> bool:
        """Whether any residual depends on anything, by more than chance."""
        rng = np.random.default_rng([self.seed, 2])
        return shape_gate(look.fitter, look.fitted, look.fitted.columns, rng).p_value <= _SHAPE_LEVEL

    def _settled(self, look: Look) -> list[Finding]:
        """Findings with the parameters and intervals of the last joint fit."""
        fitted = look.fitted
        found = intervals(look.fitter, fitted) if fitted.free else {}
        effects = {effect.name: effect for effect in fitted.effects}
        done = []
        for finding in self.findings:
            params = effects[finding.effect].model_dump(mode="json")
            done.append(finding.settled(params, found.get(finding.effect, finding.ci95)))
        return done


def _helps(best: Ranked, after: HeldOut, before: HeldOut, is_new: bool) -> bool:
    """Whether an addition may stand by what held-out frames say.

    A lattice is a fact of the file, which needs only do no harm; so is where points stand beside their beams. Other
    values of an effect that was there take more than what is new: what they fit may be any misfit of that channel.
    Those of noise are seen between neighbours.
    """
    effect = best.fitted.effects[best.place]
    if isinstance(effect, RoundingEffect):
        return not before.beats(after, share=_RETUNED_SHARE)
    if isinstance(effect, NoiseEffect) and not is_new:
        stated = after.scatters_as_stated(before, effect.channel.removesuffix("_variance"))
        return stated and not before.beats(after, share=_CALIBRATED_SHARE)
    if after.aligns(before) and not before.beats(after, _HARM_SIGMAS):
        return True
    return after.beats(before) if is_new else after.beats(before, _RETUNED_SIGMAS, _RETUNED_SHARE)


def _is_own(direction: Direction, verdict: Verdict) -> bool:
    """Whether a direction is more than scatter that beams beside each other share.

    Noise of the sensor shows between neighbours, which errors of the twin do not.
    """
    of_noise = bool(direction.column.delta) and set(direction.column.delta) <= _VARIANCES
    return not of_noise or _p_value(verdict, direction.effect) <= LEVEL


def _is_worthy(ranked: Ranked, look: Look) -> bool:
    """Whether a candidate explains more than its numbers cost: of all beams, or of the few that it is plain in.

    Likelihoods take beams for independent. With a map that is off they share what it has wrong, so that a candidate
    must be significant by itself.
    """
    is_significant = _p_value(look.verdict, ranked.effect) <= LEVEL
    if ranked.delta_bic > _LEAST_BIC:
        return is_significant or not look.fitter.sample.map_is_off
    return is_significant and ranked.sampled_bic > _LEAST_BIC


def _p_value(verdict: Verdict, effect: str) -> float:
    return min((one.p_value for one in verdict.statistics if one.direction.effect == effect), default=1.0)


def _alternative(ranked: Ranked, verdict: Verdict) -> Alternative:
    return Alternative(ranked.effect, ranked.delta_bic, _p_value(verdict, ranked.effect))

"""Which physical effects a sensor model lacks: gate, rank, add, refit, until nothing more is there."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cosim.discrepancy.add import intervals
from cosim.discrepancy.candidates import amplitudes
from cosim.discrepancy.checks import check_fit, opened
from cosim.discrepancy.compare import in_order
from cosim.discrepancy.diagnosis import Alternative, Diagnosis, Finding
from cosim.discrepancy.directions import directions
from cosim.discrepancy.fitting import Fitted, Fitter, Free, all_free
from cosim.discrepancy.frames import FrameTracer, TracedFrame
from cosim.discrepancy.gate import LEVEL, Verdict, run_gate
from cosim.discrepancy.held_out import Split, split_frames
from cosim.discrepancy.intervals import standard_errors
from cosim.discrepancy.ranking import Ranked, fit_candidate, judged_anew, shortlist
from cosim.discrepancy.sample import Sample, draw_sample
from cosim.discrepancy.testing import held_out_errors
from cosim.discrepancy.unknown import Shape, effect_name, find_shape, rank_shape, shape_gate
from cosim.kitti import Drive
from sensors.effects.base import BeamEffect, Effect
from sensors.effects.registry import effect_classes
from sensors.sensor_model import SensorModel, load_sensor

_LOG = logging.getLogger(__name__)
_ROWS, _QUICK_ROWS = 60_000, 20_000
_COARSE_M = 0.25
_FEWEST_PARTS = 120
_MOST_EFFECTS = 5
_ALIKE_BIC = 10.0
_CLEARLY_THERE = 5.0
_CLEARLY_MORE = 1.15  # times the gain of the best candidate must be an unknown shape's
_SHAPE_LEVEL = 0.02
_NO_WORSE = 1.0  # standard errors by which the held-out error may rise


@dataclass
class _Model:
    """The sensor as it stands: its effects, and which of them have been fitted here."""

    effects: tuple[Effect, ...]
    fitted: list[int] = field(default_factory=list)

    @property
    def bending(self) -> tuple[Effect, ...]:
        return tuple(effect for effect in self.effects if isinstance(effect, BeamEffect))


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
    return Detective(opened(drive), sensor, extra, seed, on_progress or _LOG.debug).run()


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
        self.split: Split = split_frames(drive.frames)
        self._kinds = candidate_kinds(extra)
        self._seed, self._say = seed, say
        self._tracer = FrameTracer(drive, self.sensor)
        self._frames: list[TracedFrame] = []

    def run(self) -> Diagnosis:
        """Everything in order."""
        model = _Model(in_order(self.sensor.effects))
        self._trace(model)
        check_fit(self._frames[0], self.drive)
        findings: list[Finding] = []
        ranking: list[Alternative] = []
        unknown: Shape | None = None
        refused: set[str] = set()
        errors = [held_out_errors(self._tracer, self.split.test, model.effects, self.sensor.origin)]
        while True:
            self._say(f"looking for effects beyond {len(findings)} found")
            fitter = Fitter(self._sample(_ROWS))
            fitted = fitter.fit(model.effects, self._free(model))
            model.effects = fitted.effects
            verdict = self._gate(fitter, fitted, model)
            if len(findings) + (unknown is not None) >= _MOST_EFFECTS:
                break
            ranked = self._rank(fitted, model, verdict) if verdict.p_value <= LEVEL else []
            ranking = ranking or [_alternative(one, verdict) for one in ranked]
            best = next((one for one in ranked if one.delta_bic > 0 and one.effect not in refused), None)
            strange = self._strange(fitter, fitted, best, refused) if unknown is None else None
            if strange is not None:
                unknown, best = strange
            if best is None:
                break
            self._say(f"adding {best.effect}")
            before = (model.effects, tuple(model.fitted))
            self._add(model, best)
            errors.append(held_out_errors(self._tracer, self.split.test, model.effects, self.sensor.origin))
            if not errors[-1].beats(errors[-2]):
                self._say(f"{best.effect} does not help on frames that took no part: taken back")
                model.effects, model.fitted = before[0], list(before[1])
                errors.pop()
                refused.add(best.effect)
                unknown = None if strange is not None else unknown
                self._trace(model)
                continue
            if strange is not None:
                continue
            findings.append(
                Finding(
                    effect=best.effect,
                    params={},
                    ci95={},
                    p_value=verdict.p_value,
                    error_before=errors[-2],
                    error_after=errors[-1],
                    also_possible=tuple(
                        one.effect
                        for one in ranked
                        if one.effect != best.effect and one.delta_bic > best.delta_bic - _ALIKE_BIC
                    ),
                    delta_bic=best.delta_bic,
                )
            )
        if self._pruned(fitter, fitted, model):
            there = {effect.name for effect in model.effects}
            findings = [one for one in findings if one.effect in there]
            fitter = Fitter(self._sample(_ROWS))
            fitted = fitter.fit(model.effects, self._free(model))
            model.effects = fitted.effects
            errors.append(held_out_errors(self._tracer, self.split.test, model.effects, self.sensor.origin))
        findings = self._settled(fitted, fitter, findings)
        return Diagnosis.of(
            drive=self.drive,
            sensor=SensorModel(self.sensor.pattern, model.effects, self.sensor.origin),
            findings=findings,
            ranking=ranking or [_alternative(one, verdict) for one in ()],
            verdict=verdict,
            errors=errors,
            split=self.split,
            unknown=unknown,
        )

    def _trace(self, model: _Model) -> None:
        self._say("tracing the twin")
        self._frames = self._traced(model.bending)

    def _traced(self, bending: tuple[Effect, ...]) -> list[TracedFrame]:
        return [self._tracer.trace(name, bending) for name in self.split.fit]

    def _sample(self, rows: int) -> Sample:
        return draw_sample(self._frames, rows, np.random.default_rng([self._seed, rows]))

    def _free(self, model: _Model) -> tuple[Free, ...]:
        return all_free(model.effects, model.fitted, self.sensor.pattern.rings)

    def _gate(self, fitter: Fitter, fitted: Fitted, model: _Model) -> Verdict:
        found = directions(fitter, fitted, self._kinds, model.fitted)
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
            fitter.poses,
            rng,
        )

    def _rank(self, fitted: Fitted, model: _Model, verdict: Verdict) -> list[Ranked]:
        """Candidates that are significant by themselves, the likeliest first."""
        fitter = Fitter(self._sample(_QUICK_ROWS))
        null = fitter.fit(model.effects, (), pose=fitted.pose, pose_sigma=fitted.pose_sigma)
        promising = shortlist(fitter, null, directions(fitter, null, self._kinds, model.fitted), verdict)
        self._say(f"fitting {', '.join(promising)}")
        ranked = [fit_candidate(fitter, null, starts) for starts in promising.values()]
        ranked.sort(key=lambda one: -one.delta_bic)
        ranked = judged_anew(ranked, fitter, null, self._traced)
        return sorted(ranked, key=lambda one: -one.delta_bic)

    def _strange(
        self, fitter: Fitter, fitted: Fitted, best: Ranked | None, refused: set[str]
    ) -> tuple[Shape, Ranked] | None:
        """A dependence that explains clearly more than the best candidate, or that is there when none is."""
        shape = find_shape(fitter, fitted)
        if shape is None or effect_name(shape) in refused:
            return None
        if best is None:
            rng = np.random.default_rng([self._seed, 2])
            if shape_gate(fitter, fitted, fitted.columns, rng).p_value > _SHAPE_LEVEL:
                return None
        quick = Fitter(self._sample(_QUICK_ROWS))
        null = quick.fit(fitted.effects, (), pose=fitted.pose, pose_sigma=fitted.pose_sigma)
        found = rank_shape(quick, null, shape)
        known = best.delta_bic if best is not None else 0.0
        return (shape, found) if found.delta_bic > _CLEARLY_MORE * known + _ALIKE_BIC else None

    def _add(self, model: _Model, best: Ranked) -> None:
        bent = model.bending
        model.effects = best.fitted.effects
        if best.place not in model.fitted:
            model.fitted.append(best.place)
        fitter = Fitter(self._sample(_ROWS))
        model.effects = fitter.fit(model.effects, self._free(model)).effects
        if model.bending != bent:
            self._trace(model)
            fitter = Fitter(self._sample(_ROWS))
            model.effects = fitter.fit(model.effects, self._free(model)).effects

    def _pruned(self, fitter: Fitter, fitted: Fitted, model: _Model) -> bool:
        """Take out what turned out to do nothing once the others were there; whether there was any."""
        idle = [place for place in model.fitted if self._is_idle(fitter, fitted, place)]
        if not idle:
            return False
        self._say(f"taking out {', '.join(model.effects[place].name for place in idle)}")
        kept = [place for place in range(len(model.effects)) if place not in idle]
        model.effects = tuple(model.effects[place] for place in kept)
        model.fitted = [kept.index(place) for place in model.fitted if place in kept]
        return True

    def _is_idle(self, fitter: Fitter, fitted: Fitted, place: int) -> bool:
        """Whether an effect's amplitudes could as well be those that do nothing, and the fit is as good without."""
        kind, errors, at = type(fitted.effects[place]), standard_errors(fitter, fitted), 0
        deviates = []
        for one in fitted.free:
            part = errors[at : at + one.unknown.rings]
            at += one.unknown.rings
            if one.effect == place and one.unknown.name in amplitudes(kind):
                apart = np.subtract(getattr(fitted.effects[place], one.unknown.name), kind.neutral[one.unknown.name])
                deviates.append(float(np.sqrt(np.mean((apart / np.maximum(part, 1e-12)) ** 2))))
        if not deviates or max(deviates) > _CLEARLY_THERE:
            return False
        rest = tuple(effect for number, effect in enumerate(fitted.effects) if number != place)
        without = fitter.fit(rest, (), pose=fitted.pose, pose_sigma=fitted.pose_sigma)
        count = sum(one.unknown.rings for one in fitted.free_of(place))
        return 2 * (fitted.loglik - without.loglik) < count * np.log(len(fitter.sample))

    def _settled(self, fitted: Fitted, fitter: Fitter, findings: Sequence[Finding]) -> list[Finding]:
        """Findings with the parameters and intervals of the last joint fit."""
        found = intervals(fitter, fitted) if fitted.free else {}
        effects = {effect.name: effect for effect in fitted.effects}
        done = []
        for finding in findings:
            params = effects[finding.effect].model_dump(mode="json")
            done.append(finding.settled(params, found.get(finding.effect, {})))
        return done


def candidate_kinds(extra: Sequence[type[Effect]] = ()) -> tuple[type[Effect], ...]:
    """Effects that a diagnosis asks for: of the catalogue, installed ones, and the user's own."""
    kinds = {kind.name: kind for kind in effect_classes().values() if kind.is_candidate}
    kinds.update({kind.name: kind for kind in extra})
    return tuple(kind for kind in kinds.values() if kind.neutral is not None and kind.stage not in ("label", "traffic"))


def _p_value(verdict: Verdict, effect: str) -> float:
    found = verdict.of(effect)
    return (
        min((one.p_value for one in verdict.statistics if one.direction.effect == effect), default=1.0)
        if found
        else 1.0
    )


def _alternative(ranked: Ranked, verdict: Verdict) -> Alternative:
    return Alternative(ranked.effect, ranked.delta_bic, _p_value(verdict, ranked.effect))

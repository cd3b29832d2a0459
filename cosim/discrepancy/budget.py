"""Attribution of the error to its sources: noise, poses, objects, map, missing effects and an unexplained rest.

Frames are scored with the random effects of poses, objects and map removed in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cosim.discrepancy.analysis import Context, FittedFrames, edge_tolerance, fit_random_effects
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.noise_floor import NeighbourPairs, NoiseFloor, estimate_floor
from cosim.discrepancy.sampling.drawing import whole_sample
from cosim.discrepancy.sampling.sample import Prediction, Sample
from cosim.discrepancy.scores import Ensemble, FrameScores, Totals, model_chance, scored
from sensors.effects.acting import bending, in_order
from sensors.effects.base import Effect
from sensors.effects.expectation import Expectation, expect

PARTS = ("poses", "objects", "map")
_Moved = tuple[np.ndarray | float, np.ndarray | float]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Errors of a model on held-out frames.

    Attributes:
        error: error over all frames (dimensionless, see `Totals.error`).
        by_frame: (f,) error of each frame.
        beams: (f,) number of comparable beams of each frame: its weight.
        floor: error caused by noise only; None if it cannot be estimated.
    """

    error: float
    by_frame: np.ndarray
    beams: np.ndarray
    floor: float | None

    @property
    def standard_error(self) -> float:
        """Standard error of the error, from its variation over frames; NaN for one frame."""
        used = np.isfinite(self.by_frame) & (self.beams > 0)
        values, count = self.by_frame[used], int(used.sum())
        share = self.beams[used] / max(self.beams[used].sum(), 1)
        if count < 2:
            return float("nan")
        return float(np.sqrt((share**2 @ (values - share @ values) ** 2) * count / (count - 1)))


@dataclass(frozen=True, eq=False)
class AlignedFrame:
    """Prediction and scores of one frame, by beam.

    Attributes:
        frame: traced frame.
        scores: scores with some random effects removed.
        expected: expectation with the same random effects removed, without the model's random sampling.
        sample: sample of all beams, with the covariates of residuals.
        prediction: prediction for them, at uncorrected poses.
        mixed: (n,) bool beams that may have hit another material, so that their intensity is ambiguous.
    """

    frame: TracedFrame
    scores: FrameScores
    expected: Expectation
    sample: Sample
    prediction: Prediction
    mixed: np.ndarray


@dataclass(frozen=True, eq=False)
class FramePairs:
    """The same frames under two models or alignments, in the same order.

    Attributes:
        before, after: frames under the first and the second model.
        align: aligns the same frames under other effects.
        before_parts: sources of the budget whose random effects are removed from `before`.
    """

    before: Aligned
    after: Aligned
    align: Callable[[Sequence[Effect]], Aligned]
    before_parts: tuple[str, ...] = PARTS

    def __len__(self) -> int:
        return len(self.after)

    def pairs(self) -> Iterator[tuple[AlignedFrame, AlignedFrame]]:
        """Iterate over frames before and after, with random effects removed (those of `before_parts` in `before`)."""
        yield from zip(self.before.each(self.before_parts), self.after.each(), strict=True)


class Aligned:
    """Frames under one model, scored with the random effects of chosen sources removed.

    Args:
        context: context of the analysis.
        on: frames and the random effects fitted to them.
        effects: effects of the model.
        others: the same frames under other models; traces of identically deflected beams are reused.
    """

    def __init__(
        self, context: Context, on: FittedFrames, effects: tuple[Effect, ...], others: Sequence[Aligned] = ()
    ) -> None:
        self._effects = in_order(effects)
        bent = bending(self._effects)
        same = bent == bending(on.fitted.effects)
        similar = next((other for other in others if bending(other._effects) == bent), None)
        if similar is not None:
            frames, self._samples = similar._frames, similar._samples
        else:
            frames = list(on.frames) if same else context.tracer.trace_all(on.names, bent)
            self._samples: dict[TracedFrame, Sample] = {}
        self._frames = frames
        self._random = on.fitter.random
        self._estimate = on.fitted.estimate if same else fit_random_effects(on, effects).estimate
        if on.fitter.sample.of_own_map:  # a sample covers only part of the map: align with the unchanged map
            without_map = self._random.without(self._estimate, ("map", "albedo_of_map"))
            self._estimate = fit_random_effects(on, effects, without_map).estimate
        sizes = edge_tolerance(self._random, self._estimate)
        self._wide = [frame.near_uncertain_edges(*sizes) if any(sizes) else None for frame in frames]
        origin = context.sensor.origin
        self._members = [
            Ensemble.of(frame, self._effects, model_chance(0, number), origin) for number, frame in enumerate(frames)
        ]
        self._held_out: dict[tuple[str, ...], HeldOut] = {}
        self._moved: dict[tuple[str, ...], list[_Moved]] = {(): [(0.0, 1.0)] * len(frames)}

    def __len__(self) -> int:
        return len(self._frames)

    def error(self, parts: tuple[str, ...]) -> float:
        """Error with the random effects of some sources removed."""
        return self.held_out(parts).error

    def floor(self) -> float | None:
        """Noise floor: error of a model that is correct up to noise; None if it cannot be estimated."""
        scores = self.scores(PARTS)
        expected = [self._expected(number, PARTS) for number in range(len(self._frames))]
        sums = [
            estimate_floor(NeighbourPairs.of(frame, frame_scores, expectation), frame_scores, expectation)
            for frame, frame_scores, expectation in zip(self._frames, scores, expected, strict=True)
        ]
        floor = NoiseFloor.of(sums)
        return None if floor is None else floor.error

    def each(self, parts: tuple[str, ...] = PARTS) -> Iterator[AlignedFrame]:
        """Iterate over the frames, with the random effects of some sources removed."""
        for number, (frame, scores) in enumerate(zip(self._frames, self.scores(parts), strict=True)):
            whole = self._whole[number]
            expected = self._expected(number, parts)
            wide = self._wide[number]
            mixed = frame.border | frame.seam if wide is None else frame.border | frame.seam | wide
            yield AlignedFrame(frame, scores, expected, whole.random.sample, whole.expected, mixed)

    def held_out(self, parts: tuple[str, ...] = ()) -> HeldOut:
        """Errors by frame, with the random effects of some sources removed."""
        if parts not in self._held_out:
            totals = [Totals.of(frame, scores) for frame, scores in zip(self._frames, self.scores(parts), strict=True)]
            by_frame, beams = np.array([total.error for total in totals]), np.array([total.beams for total in totals])
            self._held_out[parts] = HeldOut(sum(totals, Totals()).error, by_frame, beams, None)
        return self._held_out[parts]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the frames."""
        return tuple(frame.name for frame in self._frames)

    def scores(self, parts: tuple[str, ...] = PARTS) -> list[FrameScores]:
        """Scores of each frame, with the random effects of some sources removed."""
        return [
            scored(frame, members, shift, gain, wide if parts else None)
            for frame, members, (shift, gain), wide in zip(
                self._frames, self._members, self._shifts(parts), self._wide, strict=True
            )
        ]

    def _shifts(self, parts: tuple[str, ...]) -> list[_Moved]:
        """For each frame, (n,) shift of predicted ranges [m] and factor on intensities."""
        if parts not in self._moved:
            self._moved[parts] = [whole.shifts(parts) for whole in self._whole]
        return self._moved[parts]

    @cached_property
    def _whole(self) -> list[_Whole]:
        """All beams of each frame with their random effects."""
        return [
            _Whole.of(self._random, self._estimate, number, self._sample_of(frame), self._prediction_of(number))
            for number, frame in enumerate(self._frames)
        ]

    def _sample_of(self, frame: TracedFrame) -> Sample:
        """Return the sample of all beams of a frame (cached)."""
        if frame not in self._samples:
            self._samples[frame] = whole_sample(frame)
        return self._samples[frame]

    def _prediction_of(self, number: int) -> Prediction:
        """Predict all beams of a frame."""
        frame = self._frames[number]
        return self._sample_of(frame).predict_traced(self._effects, frame.shot, self._expectations[number])

    @cached_property
    def _expectations(self) -> list[Expectation]:
        return [
            expect(self._effects, frame.shot, (frame.twin_sigma_m, frame.twin_sigma_intensity))
            for frame in self._frames
        ]

    def _expected(self, number: int, parts: tuple[str, ...]) -> Expectation:
        """Expectation of a frame's beams, adjusted by the random effects of some sources."""
        expectation, (shift, gain) = self._expectations[number], self._shifts(parts)[number]
        return replace(expectation, range_m=expectation.range_m + shift, intensity=expectation.intensity * gain)


@dataclass(frozen=True, eq=False)
class _Whole:
    """All beams of one frame: prediction and random effects."""

    random: RandomEffects
    estimate: Estimate
    expected: Prediction

    @classmethod
    def of(cls, random: RandomEffects, estimate: Estimate, scan: int, sample: Sample, expected: Prediction) -> _Whole:
        """Transfer the random effects of a frame from a sample in which it is scan number `scan`."""
        has_poses = random.rows("poses").stop > random.rows("poses").start
        own = RandomEffects(sample, has_poses=has_poses)
        return cls(own, own.transferred(random, estimate, scan), expected)

    def shifts(self, parts: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Effect of the random effects of some sources: (n,) shift of ranges [m] and factor on intensities."""
        u = np.where(self.random.of_part(parts), self.estimate.u, 0.0)
        moved = self.random.adjusted(self.expected, Estimate(u, self.estimate.variance))
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.where(self.expected.intensity > 0, moved.intensity / self.expected.intensity, 1.0)
        return np.nan_to_num(moved.range_m - self.expected.range_m), gain


@dataclass(frozen=True, eq=False)
class Budget:
    """An error and its sources, on held-out frames.

    Attributes:
        error: error of the initial model at uncorrected poses.
        error_aligned: error of the final model after alignment of poses, objects and surfaces.
        given_aligned: the same for the initial model.
        floor: error of a model that is correct up to noise, on the beams of `error_aligned`; None if unknown.
        parts: noise, poses, objects, map, missing and unexplained; the sum is `error`. Each part is the mean decrease
            of the error over orders of removing the parts, so that error that two parts could explain is divided
            equally between them.
        steps: errors at uncorrected poses of the model with 0, 1, 2, … findings.
        aligned_steps: the same after alignment.
    """

    error: float
    error_aligned: float
    given_aligned: float
    floor: float | None
    parts: dict[str, float]
    steps: tuple[HeldOut, ...]
    aligned_steps: tuple[HeldOut, ...] = ()


def budget_of(context: Context, on: FittedFrames, models: Sequence[tuple[Effect, ...]]) -> tuple[Budget, FramePairs]:
    """Compute the budget of a model, or of a model to which effects were added.

    Args:
        context: context of the analysis.
        on: validation frames, fitted with the final model.
        models: effects of the initial model and after each finding.

    Returns:
        the budget, and the validation frames under the initial and the final model.
    """
    last = Aligned(context, on, models[-1])
    aligned_models = [Aligned(context, on, models[0], [last])] if len(models) > 1 else []
    for effects in models[1:-1]:
        aligned_models.append(Aligned(context, on, effects, [aligned_models[-1], last]))
    aligned_models.append(last)
    first, floor, error_aligned = aligned_models[0], last.floor(), last.error(PARTS)
    noise = error_aligned if floor is None else min(floor, error_aligned)
    parts = {"noise": noise}
    for index, name in enumerate(PARTS):
        before, after, others = PARTS[:index], PARTS[: index + 1], PARTS[index + 1 :]
        orders = ((before, after), (others, PARTS[index:]))
        decreases = [
            model.error(fewer_removed) - model.error(more_removed)
            for model in (first, last)
            for fewer_removed, more_removed in orders
        ]
        parts[name] = float(np.mean(decreases))
    parts["missing"] = 0.5 * (first.error(()) - last.error(()) + first.error(PARTS) - last.error(PARTS))
    parts["unexplained"] = error_aligned - noise
    steps, aligned_steps = (tuple(model.held_out(which) for model in aligned_models) for which in ((), PARTS))
    return Budget(first.error(()), error_aligned, first.error(PARTS), floor, parts, steps, aligned_steps), FramePairs(
        first, last, lambda effects: Aligned(context, on, tuple(effects), [first, last])
    )


def held_out(context: Context, on: FittedFrames, effects: Sequence[Effect]) -> HeldOut:
    """Errors of effects on frames at uncorrected poses, and the noise floor after alignment."""
    aligned = Aligned(context, on, tuple(effects))
    return replace(aligned.held_out(), floor=aligned.floor())

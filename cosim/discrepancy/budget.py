"""Where the error comes from: noise, poses, objects, the map, what is missing, and what nobody knows.

Frames are scored with what is merely not known of them taken out, kind by kind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cosim.discrepancy.analysis import Context, FittedFrames, edge_tolerance, fit_random_effects
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.noise_floor import Neighbours, NoiseFloor, estimate_floor
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
    """Errors of a model on frames that took no part in its fit.

    Attributes:
        error: over all of them.
        by_frame: (f,) of each.
        beams: (f,) how many of each could be compared: what it counts for.
        floor: the error that noise alone would make; None where nothing tells.
    """

    error: float
    by_frame: np.ndarray
    beams: np.ndarray
    floor: float | None

    @property
    def standard_error(self) -> float:
        """Of the error, from frame to frame; NaN of one frame."""
        used = np.isfinite(self.by_frame) & (self.beams > 0)
        values, count = self.by_frame[used], int(used.sum())
        share = self.beams[used] / max(self.beams[used].sum(), 1)
        if count < 2:
            return float("nan")
        return float(np.sqrt((share**2 @ (values - share @ values) ** 2) * count / (count - 1)))


@dataclass(frozen=True, eq=False)
class AlignedFrame:
    """What a model expects of one frame, beam by beam, and how it fares.

    Attributes:
        frame: measured and traced.
        scores: with some random effects taken out.
        expected: the same, the model's own chance left out.
        sample: all beams, with what residuals may depend on.
        prediction: of them, at the poses as given.
        mixed: (n,) bool beams that may have met another material than the model says, so that brightness tells little.
    """

    frame: TracedFrame
    scores: FrameScores
    expected: Expectation
    sample: Sample
    prediction: Prediction
    mixed: np.ndarray


@dataclass(frozen=True, eq=False)
class Judged:
    """Frames seen by two models or in two ways: `before` and `after`, in the same order.

    Attributes:
        before, after: the frames under both.
        align: aligns the same frames under other effects.
        before_parts: parts of the budget whose random effects are taken out of `before`.
    """

    before: Aligned
    after: Aligned
    align: Callable[[Sequence[Effect]], Aligned]
    before_parts: tuple[str, ...] = PARTS

    def __len__(self) -> int:
        return len(self.after)

    def pairs(self) -> Iterator[tuple[AlignedFrame, AlignedFrame]]:
        """Each frame before and after; what is merely not known is out of both, unless `before_parts` is less."""
        yield from zip(self.before.each(self.before_parts), self.after.each(), strict=True)


class Aligned:
    """Frames scored with random effects taken out of the residuals, kind by kind.

    Args:
        context: of the analysis.
        on: frames and the random effects that were fitted to them.
        effects: of the model.
        beside: the same frames as other models see them; what only depends on beams is taken from there.
    """

    def __init__(
        self, context: Context, on: FittedFrames, effects: tuple[Effect, ...], beside: Sequence[Aligned] = ()
    ) -> None:
        self._effects = in_order(effects)
        bent = bending(self._effects)
        same = bent == bending(on.fitted.effects)
        alike = next((one for one in beside if bending(one._effects) == bent), None)
        if alike is not None:
            frames, self._samples = alike._frames, alike._samples
        else:
            frames = list(on.frames) if same else context.tracer.trace_all(on.names, bent)
            self._samples: dict[TracedFrame, Sample] = {}
        self._frames = frames
        self._random = on.fitter.random
        self._estimate = on.fitted.estimate if same else fit_random_effects(on, effects).estimate
        if on.fitter.sample.of_own_map:  # aligned with the map as it is: a sample shows a part
            alone = self._random.without(self._estimate, ("map", "albedo_of_map"))
            self._estimate = fit_random_effects(on, effects, alone).estimate
        sizes = edge_tolerance(self._random, self._estimate)
        self._wide = [one.unsure(*sizes) if any(sizes) else None for one in frames]
        origin = context.sensor.origin
        self._members = [
            Ensemble.of(one, self._effects, model_chance(0, number), origin) for number, one in enumerate(frames)
        ]
        self._held_out: dict[tuple[str, ...], HeldOut] = {}
        self._moved: dict[tuple[str, ...], list[_Moved]] = {(): [(0.0, 1.0)] * len(frames)}

    def __len__(self) -> int:
        return len(self._frames)

    def error(self, parts: tuple[str, ...]) -> float:
        """The one error with the random effects of some parts of the budget taken out."""
        return self.held_out(parts).error

    def floor(self) -> float | None:
        """The error of a model that is right up to noise."""
        scores = self.scores(PARTS)
        expected = [self._expected(number, PARTS) for number in range(len(self._frames))]
        found = [
            estimate_floor(Neighbours.of(frame, one, told), one, told)
            for frame, one, told in zip(self._frames, scores, expected, strict=True)
        ]
        floor = NoiseFloor.of(found)
        return None if floor is None else floor.error

    def each(self, parts: tuple[str, ...] = PARTS) -> Iterator[AlignedFrame]:
        """Frame by frame, with the random effects of some parts of the budget taken out."""
        for number, (frame, scores) in enumerate(zip(self._frames, self.scores(parts), strict=True)):
            whole = self._whole[number]
            expected = self._expected(number, parts)
            wide = self._wide[number]
            mixed = frame.border | frame.seam if wide is None else frame.border | frame.seam | wide
            yield AlignedFrame(frame, scores, expected, whole.random.sample, whole.expected, mixed)

    def held_out(self, parts: tuple[str, ...] = ()) -> HeldOut:
        """Errors frame by frame, with the random effects of some parts of the budget taken out."""
        if parts not in self._held_out:
            each = [Totals.of(frame, scores) for frame, scores in zip(self._frames, self.scores(parts), strict=True)]
            by_frame, beams = np.array([one.error for one in each]), np.array([one.beams for one in each])
            self._held_out[parts] = HeldOut(sum(each, Totals()).error, by_frame, beams, None)
        return self._held_out[parts]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the frames."""
        return tuple(frame.name for frame in self._frames)

    def scores(self, parts: tuple[str, ...] = PARTS) -> list[FrameScores]:
        """Scores of each frame, with the random effects of some parts of the budget taken out."""
        return [
            scored(frame, members, shift, gain, wide if parts else None)
            for frame, members, (shift, gain), wide in zip(
                self._frames, self._members, self._of(parts), self._wide, strict=True
            )
        ]

    def _of(self, parts: tuple[str, ...]) -> list[_Moved]:
        """By frame, (n,) shift of predicted ranges [m] and factor of intensities."""
        if parts not in self._moved:
            self._moved[parts] = [one.shifts(parts) for one in self._whole]
        return self._moved[parts]

    @cached_property
    def _whole(self) -> list[_Whole]:
        """Every beam of each frame, with its random effects."""
        return [
            _Whole.of(self._random, self._estimate, number, self._sample_of(frame), self._prediction_of(number))
            for number, frame in enumerate(self._frames)
        ]

    def _sample_of(self, frame: TracedFrame) -> Sample:
        """All beams of a frame."""
        if frame not in self._samples:
            self._samples[frame] = whole_sample(frame)
        return self._samples[frame]

    def _prediction_of(self, number: int) -> Prediction:
        """Of all beams of a frame."""
        frame = self._frames[number]
        return self._sample_of(frame).predict_traced(self._effects, frame.shot, self._expectations[number])

    @cached_property
    def _expectations(self) -> list[Expectation]:
        return [expect(self._effects, frame.shot, (frame.unsure_m, frame.unsure_intensity)) for frame in self._frames]

    def _expected(self, number: int, parts: tuple[str, ...]) -> Expectation:
        """What is expected of a frame's beams, random effects of some parts in it."""
        told, (shift, gain) = self._expectations[number], self._of(parts)[number]
        return replace(told, range_m=told.range_m + shift, intensity=told.intensity * gain)


@dataclass(frozen=True, eq=False)
class _Whole:
    """All beams of one frame, what is expected of them, and their random effects."""

    random: RandomEffects
    told: Estimate
    expected: Prediction

    @classmethod
    def of(cls, random: RandomEffects, estimate: Estimate, scan: int, sample: Sample, expected: Prediction) -> _Whole:
        """Random effects of a frame as they were estimated from a sample in which it is scan number `scan`."""
        has_poses = random.rows("poses").stop > random.rows("poses").start
        own = RandomEffects(sample, has_poses=has_poses)
        return cls(own, own.transferred(random, estimate, scan), expected)

    def shifts(self, parts: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """What those of some parts do: (n,) shift of ranges [m] and factor of intensities."""
        u = np.where(self.random.of_part(parts), self.told.u, 0.0)
        moved = self.random.adjusted(self.expected, Estimate(u, self.told.variance))
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.where(self.expected.intensity > 0, moved.intensity / self.expected.intensity, 1.0)
        return np.nan_to_num(moved.range_m - self.expected.range_m), gain


@dataclass(frozen=True, eq=False)
class Budget:
    """An error and what it is made of, on frames that took no part in fitting effects.

    Attributes:
        error: of the model as it was given, at the poses as given.
        error_aligned: of the model as it ends, poses, objects and surfaces where the fit has them.
        given_aligned: the same of the model as it was given.
        floor: the error of a model that is right up to noise, on the beams of `error_aligned`; None if not known.
        parts: noise, poses, objects, map, missing and unexplained; they add up to `error`. Each is the mean fall
            of the error over orders in which the parts are taken out, so that what two of them could explain counts
            half to each.
        steps: errors at the poses as given, of the model with none of what was found, one, two and so on.
        aligned_steps: the same, poses, objects and surfaces where the fit has them.
    """

    error: float
    error_aligned: float
    given_aligned: float
    floor: float | None
    parts: dict[str, float]
    steps: tuple[HeldOut, ...]
    aligned_steps: tuple[HeldOut, ...] = ()


def budget_of(context: Context, on: FittedFrames, models: Sequence[tuple[Effect, ...]]) -> tuple[Budget, Judged]:
    """The budget of a model, or of one that effects were added to, and the frames that it was judged by.

    Args:
        context: of the analysis.
        on: frames that judge, as they are told in the end.
        models: the effects as given, and after every finding.
    """
    last = Aligned(context, on, models[-1])
    seen = [Aligned(context, on, models[0], [last])] if len(models) > 1 else []
    for effects in models[1:-1]:
        seen.append(Aligned(context, on, effects, [seen[-1], last]))
    seen.append(last)
    first, floor, aligned = seen[0], last.floor(), last.error(PARTS)
    noise = aligned if floor is None else min(floor, aligned)
    parts = {"noise": noise}
    for place, name in enumerate(PARTS):
        before, after, rest = PARTS[:place], PARTS[: place + 1], PARTS[place + 1 :]
        orders = ((before, after), (rest, PARTS[place:]))
        falls = [one.error(more) - one.error(less) for one in (first, last) for more, less in orders]
        parts[name] = float(np.mean(falls))
    parts["missing"] = 0.5 * (first.error(()) - last.error(()) + first.error(PARTS) - last.error(PARTS))
    parts["unexplained"] = aligned - noise
    steps, of_aligned = (tuple(one.held_out(which) for one in seen) for which in ((), PARTS))
    return Budget(first.error(()), aligned, first.error(PARTS), floor, parts, steps, of_aligned), Judged(
        first, last, lambda effects: Aligned(context, on, tuple(effects), [first, last])
    )


def held_out(context: Context, on: FittedFrames, effects: Sequence[Effect]) -> HeldOut:
    """Errors of effects on frames at the poses as given, and the floor with everything aligned."""
    one = Aligned(context, on, tuple(effects))
    return replace(one.held_out(), floor=one.floor())

"""Attribution of the error to its sources: noise, poses, objects, map, missing effects and an unexplained rest.

Frames are scored with the random effects of poses, objects and map removed in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import stats

from cosim.discrepancy.analysis import Context, FittedFrames, edge_tolerance, fit_random_effects
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.forward.reflectances import intensity_factors
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.noise_floor import NeighbourPairs, NoiseFloor, estimate_floor
from cosim.discrepancy.sampling.drawing import whole_sample
from cosim.discrepancy.sampling.sample import Prediction, Sample
from cosim.discrepancy.scores import Adjustment, Ensemble, FrameScores, Totals, model_chance, scored, spurious_ranges
from sensors.effects.acting import bending, in_order
from sensors.effects.base import Effect
from sensors.effects.expectation import Expectation, expect

PARTS = ("poses", "objects", "map")


@dataclass(frozen=True)
class Removed:
    """Sources of error that are removed.

    Attributes:
        parts: sources whose random effects are removed.
        uncertain_edges: whether beams near edges that uncertain poses and objects may have moved are left out, too.
    """

    parts: tuple[str, ...]
    uncertain_edges: bool = False


AS_GIVEN, ALIGNED = Removed(()), Removed(PARTS, uncertain_edges=True)


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

    def rises_to(self, after: HeldOut, share: float, level: float) -> bool:
        """Whether the error of another model on the same frames is higher by more than a share, and significantly.

        The test is Student's, one-sided, of the differences of the frames (paired).
        """
        used = np.isfinite(self.by_frame) & np.isfinite(after.by_frame)
        rise = (after.by_frame - self.by_frame)[used]
        if len(rise) < 2 or rise.mean() <= share * self.by_frame[used].mean():
            return False
        standard_error = max(float(rise.std(ddof=1)) / np.sqrt(len(rise)), 1e-300)
        return float(stats.t.sf(rise.mean() / standard_error, len(rise) - 1)) <= level


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
    """Scores of the same frames under two models or alignments, in the same order.

    Attributes:
        before, after: frames under the first and the second model.
        align: aligns the same frames under other effects.
        before_removed: what is removed from `before`.
    """

    before: Aligned
    after: Aligned
    align: Callable[[Sequence[Effect]], Aligned]
    before_removed: Removed = ALIGNED

    def __len__(self) -> int:
        return len(self.after)

    def pairs(self, numbers: Iterable[int] | None = None) -> Iterator[tuple[AlignedFrame, AlignedFrame]]:
        """Iterate over frames before and after, with random effects removed (`before_removed` in `before`).

        Args:
            numbers: numbers of the frames; all by default.
        """
        for number in range(len(self)) if numbers is None else numbers:
            yield self.before.frame(number, self.before_removed), self.after.frame(number)


class Aligned:
    """Frames under one model, scored with the random effects of chosen sources removed.

    Frames are scored one after another; only the ensemble of each, about 4 MB, is kept.

    Args:
        context: context of the analysis.
        on: frames and the random effects fitted to them.
        effects: effects of the model.
        others: the same frames under other models; traces of identically deflected beams are reused.
        random_of: the same frames whose random effects are used; by default they are fitted under these effects.
    """

    def __init__(
        self,
        context: Context,
        on: FittedFrames,
        effects: tuple[Effect, ...],
        others: Sequence[Aligned] = (),
        random_of: Aligned | None = None,
    ) -> None:
        self._effects = in_order(effects)
        self._origin = context.sensor.origin
        bent = bending(self._effects)
        same = bent == context.bending(on.fitted.effects)
        similar = next((other for other in others if bending(other._effects) == bent), None)
        if similar is not None:
            self._frames = similar._frames
        else:
            self._frames = on.frames if same else tuple(context.tracer.trace_all(on.names, bent))
        self._random = on.fitter.random
        if random_of is not None:
            self._estimate = random_of._estimate
        else:
            self._estimate = on.fitted.estimate if same else fit_random_effects(on, effects).estimate
            if on.fitter.sample.of_own_map:  # a sample covers only part of the map: align with the unchanged map
                without_map = self._random.without(self._estimate, ("map", "albedo_of_map"))
                self._estimate = fit_random_effects(on, effects, without_map).estimate
        self._tolerance = edge_tolerance(self._random, self._estimate)
        self._factors = intensity_factors(self._frames, in_order(context.initial_effects), self._effects)
        self._totals: dict[Removed, list[Totals]] = {}
        self._floor: list[dict[str, tuple[float, int]]] = []
        self._last: _Scan | None = None
        self._ensembles: dict[int, tuple[Ensemble, np.ndarray | None]] = {}

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def uncertain_sources(self) -> tuple[str, ...]:
        """Sources that make the positions of edges uncertain."""
        kinds = {"poses": ("poses",), "objects": ("objects", "objects_by_scan"), "map": ("map",)}
        return tuple(
            part
            for part, names in kinds.items()
            if any(np.any(self._random.spread(self._estimate, name) > 0) for name in names)
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the frames."""
        return tuple(frame.name for frame in self._frames)

    def error(self, removed: Removed) -> float:
        """Error with the random effects of some sources removed."""
        return self.held_out(removed).error

    def held_out(self, removed: Removed) -> HeldOut:
        """Errors by frame, with the random effects of some sources removed."""
        if removed not in self._totals:
            self.measure([removed])
        totals = self._totals[removed]
        by_frame, beams = np.array([total.error for total in totals]), np.array([total.beams for total in totals])
        return HeldOut(sum(totals, Totals()).error, by_frame, beams, None)

    def measure(self, several: Sequence[Removed]) -> None:
        """Compute the errors with several sets of sources removed, in one pass over the frames."""
        missing = [removed for removed in several if removed not in self._totals]
        by_changes: dict[Removed, list[Removed]] = {}
        for removed in missing:
            by_changes.setdefault(self._changes(removed), []).append(removed)
        totals = {removed: list[Totals]() for removed in missing}
        for scan in self._scans() if missing else ():
            for changes, same in by_changes.items():
                scores = scan.scores(changes)
                total = Totals.of(scan.frame, scores)
                for removed in same:
                    totals[removed].append(total)
                if ALIGNED in same:
                    expected = scan.expected(changes)
                    self._floor.append(
                        estimate_floor(NeighbourPairs.of(scan.frame, scores, expected), scores, expected)
                    )
        self._totals |= totals

    def _changes(self, removed: Removed) -> Removed:
        """The part of a removal that changes predictions: random effects that are not 0, edges with a tolerance."""
        u = self._estimate.u
        parts = tuple(part for part in removed.parts if np.any(u[self._random.of_part((part,))]))
        return Removed(parts, removed.uncertain_edges and any(self._tolerance))

    def floor(self) -> float | None:
        """Noise floor: error of a model that is correct up to noise; None if it cannot be estimated."""
        self.measure([ALIGNED])
        floor = NoiseFloor.of(self._floor)
        return None if floor is None else floor.error

    def frame(self, number: int, removed: Removed = ALIGNED) -> AlignedFrame:
        """Prediction and scores of one frame, with the random effects of some sources removed."""
        scan = self._scan(number)
        frame, wide, whole = scan.frame, scan.wide, scan.whole
        mixed = frame.border | frame.seam if wide is None else frame.border | frame.seam | wide
        return AlignedFrame(
            frame, scan.scores(removed), scan.expected(removed), whole.random.sample, whole.expected, mixed
        )

    def scores(self) -> Iterator[FrameScores]:
        """Iterate over the scores of the frames, aligned."""
        for scan in self._scans():
            yield scan.scores(ALIGNED)

    def _scans(self) -> Iterator[_Scan]:
        yield from map(self._scan, range(len(self)))

    def _scan(self, number: int) -> _Scan:
        """One frame; the last one requested is kept, because before and after are often the same."""
        if self._last is None or self._last.number != number:
            frame = self._frames[number]
            if number not in self._ensembles:
                members = Ensemble.of(frame, self._effects, model_chance(0, number), self._origin)
                self._ensembles[number] = members, self._ambiguous(frame, members) if any(self._tolerance) else None
            members, wide = self._ensembles[number]
            self._last = _Scan(
                number=number,
                frame=frame,
                effects=self._effects,
                members=members,
                random=self._random,
                estimate=self._estimate,
                wide=wide,
                factors=None if self._factors is None else self._factors[number],
            )
        return self._last

    def _ambiguous(self, frame: TracedFrame, members: Ensemble) -> np.ndarray:
        """(n,) bool beams that may hit another surface, as measured or as the model predicts for a footprint."""
        predicted = [frame.fits_nearby(range_m, *self._tolerance) for range_m in spurious_ranges(frame, members)]
        return np.any([frame.near_uncertain_edges(*self._tolerance), *predicted], axis=0)


@dataclass(frozen=True, eq=False)
class _Scan:
    """One frame under a model; what is computed of it is freed with it.

    Attributes:
        number: row of the scan in the sample to which the random effects were fitted.
        frame: traced frame.
        effects: of the model, in the order in which they act.
        members: ensemble prediction.
        random, estimate: random effects and their estimate.
        wide: (n,) bool ambiguous beams, replaces `frame.edge`.
        factors: (n,) on intensities, for the reflectances that the model gives; None for 1.
    """

    number: int
    frame: TracedFrame
    effects: tuple[Effect, ...]
    members: Ensemble
    random: RandomEffects
    estimate: Estimate
    wide: np.ndarray | None
    factors: np.ndarray | None

    def scores(self, removed: Removed) -> FrameScores:
        """Scores with the random effects of some sources removed."""
        adjustment = self._adjustment(self._moved(removed))
        return scored(self.frame, self.members, adjustment, self.wide if removed.uncertain_edges else None)

    def expected(self, removed: Removed) -> Expectation:
        """Expectation of the beams, adjusted by the random effects of some sources."""
        expectation, moved = self._expectation, self._moved(removed)
        adjustment = self._adjustment(moved)
        if adjustment is None:
            return expectation
        return replace(
            expectation,
            range_m=expectation.range_m + adjustment.shift_m,
            intensity=expectation.intensity * adjustment.gain,
            seen=expectation.seen if moved is None else moved.seen,
            silent=expectation.silent if moved is None else moved.silent,
        )

    @cached_property
    def whole(self) -> _Whole:
        """All beams of the frame with their random effects."""
        sample = whole_sample(self.frame)
        predicted = sample.predict_traced(self.effects, self.frame.shot, self._expectation)
        return _Whole.of(self.random, self.estimate, self.number, sample, predicted)

    def _moved(self, removed: Removed) -> Prediction | None:
        """Prediction with the random effects of some sources; None without any."""
        return self.whole.moved(removed.parts) if removed.parts else None

    def _adjustment(self, moved: Prediction | None) -> Adjustment | None:
        """Changes of the prediction to `moved`, and by the reflectances that the model's effects give.

        Surfaces of the sample have their own fitted reflectances where those errors are removed.
        """
        adjustment = None if moved is None else self.whole.adjustment(moved)
        if self.factors is None:
            return adjustment
        adjustment = Adjustment() if adjustment is None else adjustment
        return replace(adjustment, gain=np.where(np.equal(adjustment.gain, 1), self.factors, adjustment.gain))

    @cached_property
    def _expectation(self) -> Expectation:
        frame = self.frame
        return expect(self.effects, frame.shot, (frame.twin_sigma_m, frame.twin_sigma_intensity))


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

    def moved(self, parts: Sequence[str]) -> Prediction:
        """Prediction with the random effects of some sources applied."""
        u = np.where(self.random.of_part(parts), self.estimate.u, 0.0)
        return self.random.adjusted(self.expected, replace(self.estimate, u=u))

    def adjustment(self, moved: Prediction) -> Adjustment:
        """Changes of the prediction by random effects: to `moved`, see the method of this name."""
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.where(self.expected.intensity > 0, moved.intensity / self.expected.intensity, 1.0)
        shift_m = np.nan_to_num(moved.range_m - self.expected.range_m)
        return Adjustment(shift_m, gain, moved.silent - self.expected.silent)


@dataclass(frozen=True, eq=False)
class Budget:
    """An error and its sources, on held-out frames.

    Attributes:
        error: error of the initial model at uncorrected poses.
        error_aligned: error of the final model after alignment of poses, objects and surfaces.
        given_aligned: the same for the initial model.
        floor: error of a model that is correct up to noise, on the beams of `error_aligned`; None if unknown.
        parts: noise, poses, objects, map, missing and unexplained; the sum is `error`. Each part is the mean decrease
            of the error over two orders of removing the parts: missing effects, poses, objects and map, and the
            reverse. In both the random effects are those fitted with the final model, because without the missing
            effects they would take over what all frames share.
        steps: errors at uncorrected poses of the model with 0, 1, 2, … findings.
        aligned_steps: the same after alignment.
    """

    error: float
    error_aligned: float
    given_aligned: float
    floor: float | None
    parts: dict[str, float]
    steps: tuple[HeldOut, ...]
    aligned_steps: tuple[HeldOut, ...]

    @property
    def has_findings(self) -> bool:
        """Whether the final model has effects that are not in the initial one."""
        return len(self.steps) > 1

    def scaled_to(self, error: float) -> dict[str, float]:
        """The parts of the error of more frames: the same noise, and the same shares of what exceeds it."""
        noise = min(self.parts["noise"], error)
        excess = self.error - self.parts["noise"]
        scale = (error - noise) / excess if excess > 0 else 0.0
        return {name: noise if name == "noise" else scale * value for name, value in self.parts.items()}

    def is_raised(self, share: float, level: float) -> bool:
        """Whether the findings raise the aligned error by more than a share, and significantly."""
        return self.has_findings and self.aligned_steps[0].rises_to(self.aligned_steps[-1], share, level)


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
    given = aligned_models[0]
    # The same random effects in both models, so that removing a source means the same.
    first = Aligned(context, on, models[0], [given], random_of=last) if given is not last else last
    forward = [Removed(PARTS[:count]) for count in range(len(PARTS) + 1)]
    backward = [Removed(PARTS[count:]) for count in range(len(PARTS), -1, -1)]
    last.measure([*forward, ALIGNED])
    first.measure(backward)
    for model in aligned_models[:-1]:
        model.measure([AS_GIVEN, ALIGNED])
    error_aligned, floor = last.error(ALIGNED), last.floor()
    noise = error_aligned if floor is None else min(floor, error_aligned)
    parts = {"noise": noise}
    for index, name in enumerate(PARTS):
        then = last.error(forward[index]) - last.error(forward[index + 1])
        reverse = first.error(Removed(PARTS[index + 1 :])) - first.error(Removed(PARTS[index:]))
        parts[name] = 0.5 * (then + reverse)
    at_uncertain_edges = last.error(forward[-1]) - error_aligned
    for name in last.uncertain_sources:
        parts[name] += at_uncertain_edges / len(last.uncertain_sources)
    parts["missing"] = 0.5 * sum(first.error(which) - last.error(which) for which in (AS_GIVEN, forward[-1]))
    parts["unexplained"] = error_aligned - noise
    steps, aligned_steps = (tuple(model.held_out(which) for model in aligned_models) for which in (AS_GIVEN, ALIGNED))
    return Budget(
        given.error(AS_GIVEN), error_aligned, given.error(ALIGNED), floor, parts, steps, aligned_steps
    ), FramePairs(given, last, lambda effects: Aligned(context, on, tuple(effects), [given, last]))


def held_out(context: Context, on: FittedFrames, effects: Sequence[Effect]) -> HeldOut:
    """Errors of effects on frames at uncorrected poses, and the noise floor after alignment."""
    aligned = Aligned(context, on, tuple(effects))
    return replace(aligned.held_out(AS_GIVEN), floor=aligned.floor())

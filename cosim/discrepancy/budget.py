"""Where the error comes from: noise, poses, objects, the map, what is missing, and what nobody knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame, bending, in_order
from cosim.discrepancy.data.sample import Prediction, whole_sample
from cosim.discrepancy.forward.expectation import Expectation, expect
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.noise_floor import Neighbours, NoiseFloor, estimate_floor
from cosim.discrepancy.scores import Ensemble, FrameScores, Totals, model_chance, scored
from cosim.discrepancy.state import Case, State, View, seen_by, spreads
from cosim.discrepancy.validation import HeldOut
from sensors.effects.base import Effect

_PARTS = ("poses", "objects", "map")


@dataclass(frozen=True, eq=False)
class Budget:
    """An error and what it is made of, on frames that took no part in fitting effects.

    Attributes:
        error: of the model as it was given, at the poses as given.
        error_aligned: of the model as it ends, poses, objects and surfaces where the fit has them.
        given_aligned: the same of the model as it was given.
        floor: the error of a model that is right up to noise, on the beams of `error_aligned`; None if not known.
        parts: noise, poses, objects, map, missing and unexplained; they add up to `error`.
        steps: errors at the poses as given, of the model with none of what was found, one, two and so on.
    """

    error: float
    error_aligned: float
    given_aligned: float
    floor: float | None
    parts: dict[str, float]
    steps: tuple[HeldOut, ...]


def budget_of(case: Case, state: State, models: Sequence[tuple[Effect, ...]]) -> Budget:
    """The budget of a diagnosis.

    Args:
        case: of the diagnosis.
        state: where it ended.
        models: the effects as given, and after every finding.
    """
    last = _Aligned(case, state.judges, models[-1], state.judges.fitted.estimate)
    first = last if len(models) == 1 else _Aligned(case, state.judges, models[0], state.judges.fitted.estimate)
    steps = [first.held_out()]
    steps += [_Aligned(case, state.judges, one, state.judges.fitted.estimate).held_out() for one in models[1:-1]]
    if len(models) > 1:
        steps.append(last.held_out())
    ladder = [_PARTS[:count] for count in range(len(_PARTS) + 1)]
    of_first, of_last = ([one.error(parts) for parts in ladder] for one in (first, last))
    floor = last.floor()
    aligned = of_last[-1]
    noise = aligned if floor is None else min(floor, aligned)
    parts = {"noise": noise}
    for place, name in enumerate(_PARTS):
        falls = (levels[place] - levels[place + 1] for levels in (of_first, of_last))
        parts[name] = float(np.mean(list(falls)))
    parts["missing"] = 0.5 * (of_first[0] - of_last[0] + of_first[-1] - of_last[-1])
    parts["unexplained"] = aligned - noise
    return Budget(of_first[0], aligned, of_first[-1], floor, parts, tuple(steps))


def budget_of_view(case: Case, view: View, effects: Sequence[Effect]) -> Budget:
    """The budget of a model that nothing was added to."""
    one = _Aligned(case, view, tuple(effects), view.fitted.estimate)
    levels = [one.error(_PARTS[:count]) for count in range(len(_PARTS) + 1)]
    floor, aligned = one.floor(), levels[-1]
    noise = aligned if floor is None else min(floor, aligned)
    parts = {"noise": noise} | {name: levels[k] - levels[k + 1] for k, name in enumerate(_PARTS)}
    parts |= {"missing": 0.0, "unexplained": aligned - noise}
    return Budget(levels[0], aligned, aligned, floor, parts, (one.held_out(),))


def held_out(case: Case, view: View, effects: Sequence[Effect]) -> HeldOut:
    """Errors of effects on frames at the poses as given, and the floor with everything aligned."""
    one = _Aligned(case, view, tuple(effects), view.fitted.estimate)
    return replace(one.held_out(), floor=one.floor())


class _Aligned:
    """Frames scored with random effects taken out of the residuals, kind by kind.

    Args:
        case: of the diagnosis.
        view: frames and the random effects that were fitted to them.
        effects: of the model.
        estimate: the random effects.
    """

    def __init__(self, case: Case, view: View, effects: tuple[Effect, ...], estimate: Estimate) -> None:
        self._effects = in_order(effects)
        bent = bending(self._effects)
        same = bent == bending(view.fitted.effects)
        frames = list(view.frames) if same else case.tracer.trace_all(view.names, bent)
        self._frames = frames
        self._random = view.fitter.random
        self._estimate = estimate if same else seen_by(view, effects).estimate
        shift_m, turn_rad = spreads(self._random, self._estimate, case.settings.edge_sigmas)
        clear = shift_m < case.settings.sharp_m and turn_rad < case.settings.sharp_rad
        self._wide = [None if clear else one.unsure(shift_m, turn_rad) for one in frames]
        origin = case.sensor.origin
        self._members = [
            Ensemble.of(one, self._effects, model_chance(0, number), origin) for number, one in enumerate(frames)
        ]
        self._moved = {(): [(0.0, 1.0)] * len(frames)}
        self._expected: list[Expectation] | None = None

    def error(self, parts: tuple[str, ...]) -> float:
        """The one error with the random effects of some parts of the budget taken out."""
        each = [Totals.of(frame, scores) for frame, scores in zip(self._frames, self._scores(parts), strict=True)]
        return sum(each, Totals()).error

    def floor(self) -> float | None:
        """The error of a model that is right up to noise."""
        found = []
        moved = self._of(_PARTS)
        for frame, scores, expected, (shift, gain) in zip(
            self._frames, self._scores(_PARTS), self._expectations(), moved, strict=True
        ):
            aligned = Expectation(
                expected.range_m + shift, expected.range_sigma_m, expected.intensity * gain, expected.intensity_sigma,
                expected.seen, expected.silent,
            )  # fmt: skip
            found.append(estimate_floor(Neighbours.of(frame, scores, aligned), scores, aligned))
        floor = NoiseFloor.of(found)
        return None if floor is None else floor.error

    def held_out(self) -> HeldOut:
        """Errors at the poses as given, frame by frame."""
        each = [Totals.of(frame, scores) for frame, scores in zip(self._frames, self._scores(()), strict=True)]
        return HeldOut(
            error=sum(each, Totals()).error,
            by_frame=np.array([one.error for one in each]),
            beams=np.array([one.beams for one in each]),
            floor=None,
        )

    def _scores(self, parts: tuple[str, ...]) -> list[FrameScores]:
        return [
            scored(frame, members, shift, gain, wide if parts else None)
            for frame, members, (shift, gain), wide in zip(
                self._frames, self._members, self._of(parts), self._wide, strict=True
            )
        ]

    def _of(self, parts: tuple[str, ...]) -> list[tuple[np.ndarray | float, np.ndarray | float]]:
        """By frame, (n,) shift of predicted ranges [m] and factor of intensities."""
        if parts not in self._moved:
            self._moved[parts] = [one.shifts(parts) for one in self._whole]
        return self._moved[parts]

    @cached_property
    def _whole(self) -> list[_Whole]:
        """Every beam of each frame, with its random effects."""
        return [
            _Whole.of(self._random, self._estimate, number, frame, self._effects)
            for number, frame in enumerate(self._frames)
        ]

    def _expectations(self) -> list[Expectation]:
        if self._expected is None:
            self._expected = [expect(self._effects, frame.shot) for frame in self._frames]
        return self._expected


@dataclass(frozen=True, eq=False)
class _Whole:
    """All beams of one frame, what is expected of them, and their random effects."""

    random: RandomEffects
    told: Estimate
    expected: Prediction

    @classmethod
    def of(
        cls, random: RandomEffects, estimate: Estimate, scan: int, frame: TracedFrame, effects: Sequence[Effect]
    ) -> _Whole:
        """Random effects of a frame as they were estimated from a sample in which it is scan number `scan`."""
        has_poses = random.rows("poses").stop > random.rows("poses").start
        sample = whole_sample(frame)
        own = RandomEffects(sample, (0.0, 0.0) if has_poses else None)
        return cls(own, own.transferred(random, estimate, scan), sample.predict(effects))

    def shifts(self, parts: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """What those of some parts do: (n,) shift of ranges [m] and factor of intensities."""
        u = np.where(self.random.of_part(parts), self.told.u, self.random.start().u)
        moved = self.random.adjusted(self.expected, Estimate(u, self.told.variance))
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.where(self.expected.intensity > 0, moved.intensity / self.expected.intensity, 1.0)
        return np.nan_to_num(moved.range_m - self.expected.range_m), gain

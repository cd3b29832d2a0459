"""Errors on frames that took no part in a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cosim.discrepancy.compare import Totals
from cosim.discrepancy.data.frames import FrameTracer, TracedFrame, bending, in_order
from cosim.discrepancy.forward.expectation import expect
from cosim.discrepancy.forward.replay import FrameReplay
from cosim.discrepancy.noise_floor import Neighbours, NoiseFloor, estimate_floor, excess_scatter
from cosim.discrepancy.scores import model_chance, score_frame
from sensors.effects.base import Effect

_CLOSER = 0.9
_CALMER, _FAR_OFF = 0.5, 0.2
_EVERY = 7  # returns; enough for a mean


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Errors of a model on frames that took no part in its fit.

    Attributes:
        error: over all of them.
        by_frame: (f,) of each.
        beams: (f,) how many of each could be compared: what it counts for.
        floor: the error that noise alone would make, estimated from neighbouring beams; None where nothing matched.
        rise_m: (f,) how far points stand above or below their beams on average; 0 where files tell each point's beam.
        scatter: by frame and channel, by what share neighbours differ more than is stated, in squares.
    """

    error: float
    by_frame: np.ndarray
    beams: np.ndarray
    floor: float | None
    rise_m: np.ndarray = field(default_factory=lambda: np.zeros(0))
    scatter: Sequence[Mapping[str, float]] = ()

    @property
    def standard_error(self) -> float:
        """Of the error, from frame to frame; NaN of one frame."""
        return _mean_and_error(self.by_frame, self.beams)[1]

    def beats(self, other: HeldOut, sigmas: float = 1.0, share: float = 0.0) -> bool:
        """Whether it is smaller by more than its differences, frame by frame, leave to chance, and by a share."""
        fall, error = _mean_and_error(other.by_frame - self.by_frame, self.beams)
        if fall <= share * _mean_and_error(other.by_frame, self.beams)[0]:
            return False
        return bool(fall > sigmas * error) if np.isfinite(error) else bool(self.error < other.error)

    def aligns(self, other: HeldOut) -> bool:
        """Whether points stand closer to their beams, in every frame and by a clear share.

        The error knows nothing of that: it asks how far a surface is, not where its point was put down.
        """
        return bool(len(self.rise_m) and (self.rise_m < _CLOSER * other.rise_m).all())

    def scatters_as_stated(self, other: HeldOut, channel: str) -> bool:
        """Whether the noise of a channel is as stated, in every frame, where that of the other is far from it.

        The error tells no noise: of what is more often small than a Gaussian too little suits it as well, and where
        the twin is off too much does.
        """
        mine, others = (np.abs([frame.get(channel, 0.0) for frame in one.scatter]) for one in (self, other))
        return bool(len(mine) and ((mine < _CALMER * others) & (others > _FAR_OFF)).all())


def held_out_errors(tracer: FrameTracer, names: Sequence[str], effects: Sequence[Effect], origin: str) -> HeldOut:
    """The errors of effects on some frames."""
    effects = in_order(effects)
    each, noise, rise_m, scatter = [], [], [], []
    for number, name in enumerate(names):
        frame = tracer.trace(name, bending(effects))
        scores = score_frame(frame, effects, model_chance(0, number), origin)
        each.append(Totals.of(frame, scores))
        expected = expect(effects, frame.shot)
        beside = Neighbours.of(frame, scores, expected)
        noise.append(estimate_floor(beside, scores, expected))
        scatter.append(excess_scatter(beside))
        rise_m.append(_mean_rise(frame, effects))
    floor = NoiseFloor.of(noise)
    return HeldOut(
        error=sum(each, Totals()).error,
        by_frame=np.array([one.error for one in each]),
        beams=np.array([one.beams for one in each]),
        floor=None if floor is None else floor.error,
        rise_m=np.array(rise_m),
        scatter=tuple(scatter),
    )


def _mean_and_error(values: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """Weighted mean of values (f,), and its standard error from their scatter; NaN of fewer than two."""
    used = np.isfinite(values) & (weights > 0)
    values, share, count = values[used], weights[used] / max(weights[used].sum(), 1), int(used.sum())
    mean = float(share @ values)
    if count < 2:
        return mean, float("nan")
    return mean, float(np.sqrt((share**2 @ (values - mean) ** 2) * count / (count - 1)))


def _mean_rise(frame: TracedFrame, effects: Sequence[Effect]) -> float:
    if not frame.observed.recovered:
        return 0.0
    beams = np.flatnonzero(frame.observed.returned)[::_EVERY]
    _, _, above = FrameReplay(frame, beams).expect(effects)
    away = np.abs(frame.observed.above_m[beams] - above)
    return float(away.mean()) if len(away) else 0.0

"""Errors on frames that took no part in a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.compare import Totals
from cosim.discrepancy.expectation import expect
from cosim.discrepancy.frames import FrameTracer, bending, in_order
from cosim.discrepancy.noise_floor import NoiseFloor, estimate_floor
from cosim.discrepancy.scoring import score_frame
from sensors.effects.base import Effect


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Errors of a model on frames that took no part in its fit.

    Attributes:
        error: over all of them.
        by_frame: (f,) of each.
        floor: the error that noise alone would make, estimated from neighbouring beams; None where nothing matched.
    """

    error: float
    by_frame: np.ndarray
    floor: float | None

    @property
    def standard_error(self) -> float:
        """Of the error, from frame to frame; NaN of one frame."""
        count = len(self.by_frame)
        return float(np.std(self.by_frame, ddof=1) / np.sqrt(count)) if count > 1 else float("nan")

    def beats(self, other: HeldOut, sigmas: float = 1.0, share: float = 0.0) -> bool:
        """Whether it is smaller by more than its differences, frame by frame, leave to chance, and by a share."""
        fall = other.by_frame - self.by_frame
        if fall.mean() <= share * other.by_frame.mean():
            return False
        if len(fall) < 2:
            return bool(self.error < other.error)
        return bool(fall.mean() > sigmas * np.std(fall, ddof=1) / np.sqrt(len(fall)))


def held_out_errors(tracer: FrameTracer, names: Sequence[str], effects: Sequence[Effect], origin: str) -> HeldOut:
    """The errors of effects on some frames."""
    effects = in_order(effects)
    each, noise = [], []
    for number, name in enumerate(names):
        frame = tracer.trace(name, bending(effects))
        scores = score_frame(frame, effects, np.random.default_rng([0, number]), origin)
        each.append(Totals.of(frame, scores))
        noise.append(estimate_floor(frame, scores, expect(effects, frame.shot)))
    floor = NoiseFloor.of(noise)
    return HeldOut(
        sum(each, Totals()).error, np.array([one.error for one in each]), None if floor is None else floor.error
    )

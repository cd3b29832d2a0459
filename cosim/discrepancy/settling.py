"""Fits effects, traces the beams that they bend anew, and fits again, until both agree.

A fit holds on to the planes that beams met when they were traced. Once it bends them so far that they meet something
else, its answer is only a better place to trace from.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.fitting import Fitted, Fitter, Free
from cosim.discrepancy.frames import TracedFrame, bending
from cosim.discrepancy.sample import draw_sample
from sensors.effects.base import Effect

ROWS = 60_000
_ROUNDS = 4
_ASIDE_RAD, _ASIDE_M = 5e-4, 0.01  # a beam that moved by more may meet another surface

Trace = Callable[[tuple[Effect, ...]], list[TracedFrame]]


@dataclass(frozen=True, eq=False)
class Settled:
    """A fit, and frames traced as it bends their beams."""

    frames: list[TracedFrame]
    fitter: Fitter
    fitted: Fitted


def settle(
    frames: list[TracedFrame],
    trace: Trace,
    effects: Sequence[Effect],
    free: Sequence[Free],
    seed: int,
) -> Settled:
    """Fit parameters of effects to frames.

    Args:
        frames: traced with whatever beam effects.
        trace: traces them with others.
        effects: all of the sensor.
        free: what may change.
        seed: of the sample.
    """
    effects = tuple(effects)
    for left in reversed(range(_ROUNDS)):
        fitter = Fitter(draw_sample(frames, ROWS, np.random.default_rng([seed, ROWS])))
        fitted = fitter.fit(effects, free)
        effects = fitted.effects
        moved = fitter.sample.moved(effects)
        if not left or (moved[0] < _ASIDE_RAD and moved[1] < _ASIDE_M):
            return Settled(frames, fitter, fitted)
        frames = trace(bending(effects))
    raise AssertionError  # the last round returns

"""Fits effects, traces the beams that they bend anew, and fits again, until both agree.

A fit holds on to the planes that beams met when they were traced. Once it bends them so far, by effects or by the pose
errors of their scan, that they meet something else, its answer is only a better place to trace from. How far the
twin is off shows in a fit, too, and the next one knows it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame, bending
from cosim.discrepancy.data.sample import Sample, draw_sample
from cosim.discrepancy.inference.fit import Fitted, Fitter, Free
from cosim.discrepancy.twin_scatter import differs, measured_scatter, with_scatter
from sensors.effects.base import Effect

ROWS = 60_000
_ROUNDS = 4
_ASIDE_RAD, _ASIDE_M = 5e-4, 0.01  # a beam that moved by more may meet another surface

Trace = Callable[[tuple[Effect, ...], np.ndarray], list[TracedFrame]]


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
    pose: np.ndarray | None = None,
    near: Collection[int] = (),
) -> Settled:
    """Fit parameters of effects to frames.

    Args:
        frames: traced with whatever beam effects.
        trace: traces them with others, and with pose errors (scans, 6).
        effects: all of the sensor.
        free: what may change.
        seed: of the sample.
        pose: (scans, 6) pose errors to start with, else those that frames were traced with.
        near: places of effects that are about right already; after a first fit all are.
    """
    effects, straightened = tuple(effects), False
    for left in reversed(range(_ROUNDS)):
        fitter = Fitter(draw_sample(frames, ROWS, np.random.default_rng([seed, ROWS])))
        fitted = fitter.fit(effects, free, pose=pose, near=near)
        effects, pose, near = fitted.effects, fitted.pose, range(len(effects))
        scatter, aside = measured_scatter(frames, fitter, fitted), _aside(fitter.sample, effects)
        if not straightened and leans(pose, fitter.sample.leaning):
            # Once: where poses make up for what is missing they never settle.
            aside = straightened = True
        if not left or not (aside or differs(scatter, frames[0].scatter)):
            return Settled(frames, fitter, fitted)
        frames = with_scatter(trace(bending(effects), pose) if aside else frames, scatter)
    raise AssertionError  # the last round returns


def _aside(sample: Sample, effects: Sequence[Effect]) -> bool:
    """Whether effects let beams look or stand elsewhere than when they were traced."""
    turned, moved = sample.moved(effects)
    return turned > _ASIDE_RAD or moved > _ASIDE_M


def leans(pose: np.ndarray, traced: np.ndarray) -> bool:
    """Whether pose errors (scans, 6) are so far from others that beams may meet other surfaces."""
    apart = np.abs(pose - traced)
    return bool(apart[:, 3:].max(initial=0) > _ASIDE_RAD or apart[:, :3].max(initial=0) > _ASIDE_M)

"""Errors on frames that took no part in a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.discrepancy.compare import Totals, in_order
from cosim.discrepancy.frames import FrameTracer
from cosim.discrepancy.scoring import score_frame
from sensors.effects.base import BeamEffect, Effect


def held_out_errors(
    tracer: FrameTracer, names: Sequence[str], effects: Sequence[Effect], origin: str
) -> tuple[float, float]:
    """The error over frames and its standard error from frame to frame."""
    effects = in_order(effects)
    bending = tuple(effect for effect in effects if isinstance(effect, BeamEffect))
    each = []
    for number, name in enumerate(names):
        frame = tracer.trace(name, bending)
        each.append(Totals.of(frame, score_frame(frame, effects, np.random.default_rng([0, number]), origin)))
    total = sum(each, Totals())
    spread = np.std([one.error for one in each], ddof=1) / np.sqrt(len(each)) if len(each) > 1 else float("nan")
    return total.error, float(spread)

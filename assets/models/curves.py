"""Smooth curves through a few control points."""

from __future__ import annotations

import numpy as np


def monotone_cubic(knots: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Cubic through control points that never overshoots them; constant beyond its ends.

    The slopes are those of Fritsch and Carlson, "Monotone piecewise cubic interpolation", 1980, in the
    harmonic-mean form of Fritsch and Butland.

    Args:
        knots: (k,) increasing.
        values: (k,).
        at: any shape.
    """
    knots, values = np.asarray(knots, np.float64), np.asarray(values, np.float64)
    at = np.clip(np.asarray(at, np.float64), knots[0], knots[-1])
    step = np.diff(knots)
    secant = np.diff(values) / step
    before, after = secant[:-1], secant[1:]
    w1, w2 = 2 * step[1:] + step[:-1], step[1:] + 2 * step[:-1]
    rising = before * after > 0
    inner = np.zeros_like(before)
    inner[rising] = (w1 + w2)[rising] / (w1[rising] / before[rising] + w2[rising] / after[rising])
    slope = np.concatenate([secant[:1], inner, secant[-1:]])
    i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(step) - 1)
    h, t = step[i], (at - knots[i]) / step[i]
    return (
        values[i] * (1 + 2 * t) * (1 - t) ** 2
        + slope[i] * h * t * (1 - t) ** 2
        + values[i + 1] * t**2 * (3 - 2 * t)
        + slope[i + 1] * h * t**2 * (t - 1)
    )


def smooth_step(low: float, high: float, at: np.ndarray) -> np.ndarray:
    """0 below `low`, 1 above `high`, a cubic between."""
    t = np.clip((np.asarray(at, np.float64) - low) / (high - low), 0.0, 1.0)
    return t * t * (3 - 2 * t)

"""Likelihood of values that a sensor cuts off at limits: a censored Student-t (Tobin, Econometrica 1958).

A value inside the limits has its density; one at a limit only says that it would have been there or beyond.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import special, stats

NU = 5.0
SCALE = np.sqrt((NU - 2) / NU)
MEAN_INFORMATION = (NU + 1) / (NU + 3) * NU / (NU - 2)
_LOG_NORM = float(special.gammaln((NU + 1) / 2) - special.gammaln(NU / 2) - 0.5 * np.log(NU * np.pi))
_FAR = 8.0
_KNOTS = 1601


def student(z: np.ndarray) -> np.ndarray:
    """Log-density of a Student-t scaled to unit variance."""
    return _LOG_NORM - np.log(SCALE) - (NU + 1) / 2 * np.log1p(z**2 / (SCALE**2 * NU))


def pull(z: np.ndarray) -> np.ndarray:
    """−d log f/dz of the unit-variance Student-t: bounded."""
    return (NU + 1) * z / (SCALE**2 * NU + z**2)


@dataclass(frozen=True, eq=False)
class Censored:
    """Of n values.

    Attributes:
        loglik: log-density, or log-probability of those at a limit.
        pull: its slope against the expected value, in standard deviations.
        information: expected square of the slope; `MEAN_INFORMATION` far from limits.
    """

    loglik: np.ndarray
    pull: np.ndarray
    information: np.ndarray


def censored(value: np.ndarray, mean: np.ndarray, spread: np.ndarray, limits: tuple[float, float]) -> Censored:
    """Hold values (n,) against what is expected of them before they are cut off at the limits."""
    low, high = ((limit - mean) / spread for limit in limits)
    z = (value - mean) / spread
    loglik, slope = student(z) - np.log(spread), pull(z)
    for at, beyond, side in ((value <= limits[0], -low, -1.0), (value >= limits[1], high, 1.0)):
        room = beyond[at]
        outside = stats.t.sf(room / SCALE, NU)
        loglik[at] = np.log(outside)
        slope[at] = side * np.exp(student(room)) / outside
    information = _known_below(high) + _known_below(-low) - MEAN_INFORMATION
    return Censored(loglik, slope, np.maximum(information, 0.0))


def _known_below(room: np.ndarray) -> np.ndarray:
    """Information of values cut off at `room` (n,) standard deviations above their mean."""
    return np.interp(room, *_table())


@cache
def _table() -> tuple[np.ndarray, np.ndarray]:
    room = np.linspace(-_FAR, _FAR, _KNOTS)
    square = pull(room) ** 2 * np.exp(student(room))
    inside = np.append(0.0, np.cumsum((square[1:] + square[:-1]) / 2 * np.diff(room)))
    inside *= MEAN_INFORMATION / inside[-1]
    outside = np.exp(2 * student(room)) / stats.t.sf(room / SCALE, NU)
    return room, inside + outside

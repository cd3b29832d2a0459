"""Mean and standard deviation of rounded values.

A normal deviate of mean m and standard deviation s, rounded to multiples of δ, is kδ with probability
Φ((kδ + δ/2 − m)/s) − Φ((kδ − δ/2 − m)/s). Where s is well above δ its mean stays and its variance grows by δ²/12
(Sheppard 1898); for small s only one or two steps occur.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import ndtr

from sensors.effects.base import RoundingEffect
from sensors.returns import Returns

_SHEPPARD = 0.75  # s/δ above which the sum over steps adds nothing
_ASIDE = 4


def rounded(
    returns: Returns, effect: RoundingEffect, range_sigma_m: np.ndarray, intensity_sigma: np.ndarray
) -> tuple[Returns, tuple[np.ndarray, np.ndarray]]:
    """Returns of mean values, and the variances (m,) of range and intensity, after rounding."""
    steps = effect.steps
    range_m, of_range = _moments(returns.range_m, range_sigma_m, steps[0])
    intensity, of_intensity = _moments(returns.intensity, intensity_sigma, steps[1])
    changed = replace(returns, range_m=range_m.astype(np.float32), intensity=intensity.astype(np.float32))
    return changed, (of_range, of_intensity)


def _moments(mean: np.ndarray, sigma: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    if not step:
        return mean, sigma**2
    found, variance = mean.astype(np.float64), sigma**2 + step**2 / 12
    few = np.flatnonzero(sigma < _SHEPPARD * step)
    centre, spread = found[few] / step, np.maximum(sigma[few] / step, 1e-6)
    lowest = np.rint(centre) - _ASIDE
    edges = lowest[:, None] - 0.5 + np.arange(2 * _ASIDE + 2)
    chance = np.diff(ndtr((edges - centre[:, None]) / spread[:, None]), axis=1)
    chance /= chance.sum(1, keepdims=True)
    at = lowest[:, None] + np.arange(2 * _ASIDE + 1)
    first = (chance * at).sum(1)
    found[few] = first * step
    variance[few] = (chance * (at - first[:, None]) ** 2).sum(1) * step**2
    return found, variance

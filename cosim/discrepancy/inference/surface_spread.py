"""Spread of points about the surfaces of a twin that was made from scans, as a variance component by material.

Such a twin states how far points scattered about each surface when it was made. This includes errors that the random
effects of a fit correct (poses, positions of surfaces), and part of the noise of the sensor. The stated σ are therefore
multiplied by a factor for each material, which is estimated from the residuals, and a second one for the part that
neighbouring beams do not have in common, from differences of their residuals. Noise of the sensor is constant along a
beam; roughness of a surface changes ranges by more at grazing incidence, so that the two can be distinguished.

Residuals of a fit are smaller than the errors, because the surfaces have been moved towards the points. Their squares
are divided by 1 − h, where h is the leverage (Hoaglin and Welsch, The American Statistician 32, 1978).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cosim.discrepancy.inference.likelihood import MEAN_INFORMATION, Residuals, student
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.inference.score import spread_excess

_FACTORS = (0.5, 0.8, 0.95, 1.05, 1.25, 2.0)  # trial factors on the present value in each step
_LIMITS = (0.02, 3.0)
_FEWEST = 100.0  # returns of a material
_MOST_LEVERAGE = 0.9


def updated_surface_spread(random: RandomEffects, residuals: Residuals, estimate: Estimate) -> np.ndarray:
    """Factors (2, k) on the stated σ of the twin's surfaces after one step towards the maximum likelihood.

    Args:
        random, estimate: random effects of the sample and their estimate.
        residuals: of the prediction with these random effects.
    """
    sample, now = random.sample, estimate.surface_spread
    stated = sample.twin_sigma_m
    if not stated.any():
        return now
    matched, material, pair = sample.share * residuals.matched, sample.material, np.maximum(sample.partner, 0)
    error_m = residuals.range_z * residuals.range_sigma_m
    rest = np.maximum(residuals.range_sigma_m**2 - (now[0, material] * stated) ** 2, 1e-12)  # of the sensor
    paired = matched * residuals.matched[pair] * (sample.partner >= 0)

    def by_material(values: np.ndarray) -> np.ndarray:
        return np.bincount(material, np.where(stated > 0, values, 0.0), now.shape[1])

    def loglik(factors: np.ndarray) -> np.ndarray:
        sigma = np.sqrt(rest + (factors[material] * stated) ** 2)
        leverage = random.map_leverage(matched * MEAN_INFORMATION / sigma**2, estimate)
        shrunk = sigma * np.sqrt(1 - np.minimum(leverage, _MOST_LEVERAGE))
        return by_material(matched * (student(error_m / shrunk) - np.log(sigma)))

    def balance(factors: np.ndarray) -> np.ndarray:
        """0 where the squares of the differences are as large as stated, as in the scores of variances; else below."""
        sigma = np.sqrt(rest + (factors[material] * stated) ** 2)
        gap = (error_m / sigma - (error_m / sigma)[pair]) / np.sqrt(2)
        return -np.abs(by_material(paired * spread_excess(gap, sample.settings.likelihood)))

    known = [by_material(weight) >= _FEWEST for weight in (matched, paired)]
    return np.stack([
        np.where(known[0], _improved(now[0], loglik), now[0]),
        np.where(known[1], _improved(now[1], balance), now[1]),
    ])  # fmt: skip


def _improved(now: np.ndarray, quality: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """The best of trial factors (k,), each by its own `quality` (k,)."""
    best, reached = now, quality(now)
    for factor in _FACTORS:
        trial = np.clip(now * factor, *_LIMITS)
        value = quality(trial)
        best, reached = np.where(value > reached, trial, best), np.maximum(value, reached)
    return best

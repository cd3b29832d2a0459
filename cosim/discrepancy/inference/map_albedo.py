"""Reflectances of the surfaces of a map that was made from the drive's own scans."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.discrepancy.inference.likelihood import intensity_loglik
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.sampling.sample import Prediction


def updated_map_albedo(
    random: RandomEffects, prediction: Prediction, matched: np.ndarray, estimate: Estimate, other: Estimate | None
) -> Estimate:
    """Choose the most likely albedo of each map surface from trial values; everything else is fixed.

    Only for maps made from the scans. Noise grows with brightness, so that gradient steps may fail for dark or mixed
    surfaces.

    Args:
        random, estimate: random effects of the sample and their estimate.
        prediction: of the effects.
        matched: (n,) weight of each beam that returned from its surface.
        other: the trial values are its albedos; None: multiples of the current ones.
    """
    rows, sample = random.rows("albedo_of_map"), random.sample
    if not sample.of_own_map or rows.stop == rows.start:
        return estimate
    settings = sample.settings
    brightness, darkest = 1 + estimate.u[rows], settings.random_effects.darkest
    penalty = random.precision(estimate)[rows] / 2
    surface, used = np.maximum(sample.surface, 0), matched * (sample.surface >= 0)
    if other:
        trials = [1 + other.u[rows]]
    else:
        expected = random.brightened(prediction, estimate).intensity
        measured, predicted = (
            np.bincount(surface, used * np.where(sample.returned, values, 0.0), len(brightness))
            for values in (sample.intensity, expected)
        )
        by_mean = np.where(predicted > 0, measured / np.where(predicted > 0, predicted, 1.0), 1.0)
        trials = [by * brightness for by in (by_mean, *settings.descent.brightnesses)]

    def with_brightness(values: np.ndarray) -> Estimate:
        changed = replace(estimate, u=estimate.u.copy())
        changed.u[rows] = values - 1
        return changed

    def loglik_of(values: np.ndarray) -> np.ndarray:
        """The part of each surface's penalised log-likelihood that depends on its albedo."""
        expected = random.brightened(prediction, with_brightness(values))
        by_surface = np.bincount(surface, used * intensity_loglik(sample, expected), len(values))
        return by_surface - penalty * (values - 1) ** 2

    best, reached = brightness, loglik_of(brightness)
    for trial in (np.maximum(values, darkest) for values in trials):
        value = loglik_of(trial)
        best, reached = np.where(value > reached, trial, best), np.maximum(value, reached)
    return with_brightness(best)

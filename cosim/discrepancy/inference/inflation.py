"""Inflated standard deviations with which a fit converges from large residuals (graduated optimisation)."""

from __future__ import annotations

import numpy as np

from cosim.discrepancy.inference.likelihood import range_spread_m
from cosim.discrepancy.sampling.sample import Prediction, Sample


def inflations_of(sample: Sample, prediction: Prediction) -> tuple[float, ...]:
    """Decreasing additions to σ [m] for the residuals of a prediction; none if no residuals are large."""
    inflations_m, blur_m = list[float](), _large_residuals_m(sample, prediction)
    while blur_m > 0:
        inflations_m.append(blur_m)
        blur_m = blur_m / 4 if blur_m / 4 > sample.settings.descent.fine_m else 0.0
    return tuple(inflations_m)


def _large_residuals_m(sample: Sample, prediction: Prediction) -> float:
    """Scale of the large range or rise residuals [m]; 0 if all are within a few standard deviations."""
    constants = sample.settings.likelihood
    compared = np.where(sample.compared, sample.along_m - prediction.range_m, np.nan)
    stated_m = float(np.median(range_spread_m(prediction, constants)))
    rise = sample.above_m - prediction.rise_m
    return max(_scale_m(sample, compared, stated_m), _scale_m(sample, rise, constants.rise_sigma_m))


def _scale_m(sample: Sample, residual_m: np.ndarray, stated_m: float) -> float:
    """Scale of the large ones among residuals (n,) with a stated standard deviation [m]; 0 if none is large."""
    size, descent = np.abs(residual_m), sample.settings.descent
    near = np.isfinite(size) & (size < descent.far_m)
    if not near.any():
        return 0.0
    order = np.argsort(size[near])
    below = np.cumsum(sample.weight[near][order])
    wide = float(size[near][order][np.searchsorted(below, descent.rough_share * below[-1])])
    return wide if wide > descent.rough * max(stated_m, descent.fine_m) else 0.0

"""What residuals say about a change of the prediction, channel by channel.

For a change Δ of a predicted quantity (mean range, log spread, probability …) a beam contributes `score`·Δ to the
slope of the log-likelihood and `information`·Δ² to its curvature.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cosim.discrepancy.data.sample import Prediction, Sample
from cosim.discrepancy.inference.censored import MEAN_INFORMATION, pull
from cosim.discrepancy.inference.likelihood import (
    RANGE_FLOOR_M,
    RISE_SIGMA_M,
    Fit,
    intensity_spread,
    own_range_spread_m,
)

Quantity = Literal["range", "rise", "intensity", "range_variance", "intensity_variance", "drop"]
QUANTITIES: tuple[Quantity, ...] = ("range", "rise", "intensity", "range_variance", "intensity_variance", "drop")
ROUNDED_M = 6e-4  # to which coordinates may be stored
_SPREAD_INFORMATION = 2.0  # of a Gaussian: of d log σ, E[(z² − 1)²]; and E[z² − 1] grows by 2 a unit of it
_MOST_SQUARED = 100.0
_MOST_SHARED = 1.0  # times the noise
_FAR_OFF = 3.0  # standard deviations


@dataclass(frozen=True, eq=False)
class Evidence:
    """Scores and informations of n beams, by quantity."""

    score: dict[Quantity, np.ndarray]
    information: dict[Quantity, np.ndarray]

    @classmethod
    def of(cls, sample: Sample, fit: Fit, rise_blur: float = 0.0, rounded_m: float = 0.0) -> Evidence:
        """The evidence in a fit; weighted so that beams of the sample stand for all.

        Points within `rounded_m` of their beam count as on it: coordinates are stored to so much.
        """
        weight = sample.share
        matched, returned = weight * fit.matched, weight * sample.returned
        rise_sigma = np.hypot(RISE_SIGMA_M, rise_blur)
        variance = fit.seen * (1 - fit.seen)
        possible = variance > 0
        pair = np.maximum(sample.partner, 0)
        paired = weight * fit.matched * fit.matched[pair] * (sample.partner >= 0)
        own_sigma_m = np.sqrt(np.maximum(fit.range_sigma_m**2 - sample.shared_m**2, RANGE_FLOOR_M**2))
        told = paired * (sample.shared_m < _MOST_SHARED * own_sigma_m)  # a surface that is off leans, too
        range_gap = (fit.range_z - fit.range_z[pair]) / np.sqrt(2) * fit.range_sigma_m / own_sigma_m
        intensity_gap = (fit.intensity_z - fit.intensity_z[pair]) / np.sqrt(2)
        binary = np.where(possible, weight / np.where(possible, variance, 1), 0.0)
        score: dict[Quantity, np.ndarray] = {
            "range": matched * pull(fit.range_z) / fit.range_sigma_m,
            "rise": returned * pull(fit.rise_z) / rise_sigma * (np.abs(fit.rise_z) * rise_sigma > rounded_m),
            "range_variance": told * spread_excess(range_gap),
            "drop": binary * (fit.matched - fit.seen),
        }
        information: dict[Quantity, np.ndarray] = {
            "range": matched * MEAN_INFORMATION / fit.range_sigma_m**2,
            "rise": returned * MEAN_INFORMATION / rise_sigma**2,
            "range_variance": told * _SPREAD_INFORMATION,
            "drop": binary,
        }
        if sample.has_intensity:
            bright = weight * fit.bright
            plain = fit.bright * fit.whole * ~sample.seam
            lit = weight * plain * plain[pair] * (sample.partner >= 0)
            score["intensity"] = bright * fit.intensity_pull / fit.intensity_sigma
            information["intensity"] = bright * fit.intensity_known / fit.intensity_sigma**2
            score["intensity_variance"] = lit * spread_excess(intensity_gap)
            information["intensity_variance"] = lit * _SPREAD_INFORMATION
        return cls(score, information)

    def reweighted(self, fit: Fit) -> Evidence:
        """With the curvature of ranges far off that their pull has (iterated reweighting of a Student-t).

        On average over noise curvatures are as they are said; beams that are far off would hold a step back by the
        curvature of beams that fit, though they hardly pull at all.
        """
        far = np.abs(fit.range_z) > _FAR_OFF
        residual = np.where(far, fit.range_z, 1.0) * fit.range_sigma_m
        loose = np.where(far, self.score["range"] / residual, self.information["range"])
        information: dict[Quantity, np.ndarray] = {**self.information, "range": loose}
        return Evidence(self.score, information)


def change(before: Prediction, after: Prediction) -> dict[Quantity, np.ndarray]:
    """How a prediction changes, (n,) by quantity; quantities that stay are left out."""
    both = np.isfinite(before.range_m) & np.isfinite(after.range_m)
    # A change of reported centre moves points along and across; what was measured stays.
    found: dict[Quantity, np.ndarray] = {
        "range": np.where(both, after.range_m - before.range_m, 0.0),
        "rise": np.nan_to_num(after.rise_m - before.rise_m),
        "intensity": after.intensity - before.intensity,
        "range_variance": np.log(own_range_spread_m(after) / own_range_spread_m(before)),
        "intensity_variance": np.log(intensity_spread(after) / intensity_spread(before)),
        "drop": after.seen - before.seen,
    }
    return {name: values for name, values in found.items() if np.any(np.abs(values) > 1e-12)}


def spread_excess(gap: np.ndarray) -> np.ndarray:
    """Above 0 where neighbours scatter more than stated, 0 on average for any law of the stated standard deviation."""
    return np.minimum(gap**2, _MOST_SQUARED) - 1

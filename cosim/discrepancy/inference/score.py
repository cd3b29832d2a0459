"""What residuals say about a change of the prediction, channel by channel.

For a change Δ of a predicted quantity (mean range, log spread, probability …) a beam contributes `score`·Δ to the
slope of the log-likelihood and `information`·Δ² to its curvature.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cosim.discrepancy.inference.censored import MEAN_INFORMATION, pull
from cosim.discrepancy.inference.likelihood import Fit, intensity_spread, range_spread_m
from cosim.discrepancy.sampling.sample import Prediction, Sample
from cosim.discrepancy.settings import Law

Quantity = Literal["range", "rise", "intensity", "range_variance", "intensity_variance", "drop"]
QUANTITIES: tuple[Quantity, ...] = ("range", "rise", "intensity", "range_variance", "intensity_variance", "drop")
_SPREAD_INFORMATION = 2.0  # of a Gaussian: of d log σ, E[(z² − 1)²]; and E[z² − 1] grows by 2 a unit of it


@dataclass(frozen=True, eq=False)
class Evidence:
    """Scores and informations of n beams, by quantity."""

    score: dict[Quantity, np.ndarray]
    information: dict[Quantity, np.ndarray]

    @classmethod
    def of(cls, sample: Sample, fit: Fit, rise_blur: float = 0.0, wider: tuple[float, float] = (1.0, 1.0)) -> Evidence:
        """The evidence in a fit; weighted so that beams of the sample stand for all.

        Args:
            sample, fit: the measurements, and how a model fits them.
            rise_blur: a standard deviation [m] added to every rise.
            wider: by how much ranges and rises scatter more than is stated, see `dispersion`.
        """
        weight, law = sample.share, sample.settings.law
        matched, returned = weight * fit.matched, weight * sample.returned
        range_z, range_sigma = fit.range_z / wider[0], fit.range_sigma_m * wider[0]
        rise_z, rise_sigma = fit.rise_z / wider[1], np.hypot(law.rise_sigma_m, rise_blur) * wider[1]
        variance = fit.seen * (1 - fit.seen)
        possible = variance > 0
        pair = np.maximum(sample.partner, 0)
        paired = weight * fit.matched * fit.matched[pair] * (sample.partner >= 0)
        range_gap = (fit.range_z - fit.range_z[pair]) / np.sqrt(2)
        intensity_gap = (fit.intensity_z - fit.intensity_z[pair]) / np.sqrt(2)
        binary = np.where(possible, weight / np.where(possible, variance, 1), 0.0)
        score: dict[Quantity, np.ndarray] = {
            "range": matched * pull(range_z) / range_sigma,
            "rise": returned * pull(rise_z) / rise_sigma,
            "range_variance": paired * _spread_excess(range_gap, law),
            "drop": binary * (fit.matched - fit.met * fit.expected_seen),
        }
        information: dict[Quantity, np.ndarray] = {
            "range": matched * MEAN_INFORMATION / range_sigma**2,
            "rise": returned * MEAN_INFORMATION / rise_sigma**2,
            "range_variance": paired * _SPREAD_INFORMATION,
            "drop": binary * fit.met,
        }
        if sample.has_intensity:
            bright = weight * fit.bright
            plain = fit.bright * fit.whole * ~sample.seam
            lit = weight * plain * plain[pair] * (sample.partner >= 0)
            score["intensity"] = bright * fit.intensity_pull / fit.intensity_sigma
            information["intensity"] = bright * fit.intensity_known / fit.intensity_sigma**2
            score["intensity_variance"] = lit * _spread_excess(intensity_gap, law)
            information["intensity_variance"] = lit * _SPREAD_INFORMATION
        return cls(score, information)

    def reweighted(self, fit: Fit, law: Law) -> Evidence:
        """With the curvature of ranges far off that their pull has (iterated reweighting of a Student-t).

        On average over noise curvatures are as they are said; beams that are far off would hold a step back by the
        curvature of beams that fit, though they hardly pull at all.
        """
        far = np.abs(fit.range_z) > law.far_off
        residual = np.where(far, fit.range_z, 1.0) * fit.range_sigma_m
        loose = np.where(far, self.score["range"] / residual, self.information["range"])
        information: dict[Quantity, np.ndarray] = {**self.information, "range": loose}
        return Evidence(self.score, information)


def change(before: Prediction, after: Prediction, law: Law) -> dict[Quantity, np.ndarray]:
    """How a prediction changes, (n,) by quantity; quantities that stay are left out."""
    both = np.isfinite(before.range_m) & np.isfinite(after.range_m)
    # A change of reported centre moves points along and across; what was measured stays.
    found: dict[Quantity, np.ndarray] = {
        "range": np.where(both, after.range_m - before.range_m, 0.0),
        "rise": np.nan_to_num(after.rise_m - before.rise_m),
        "intensity": after.intensity - before.intensity,
        "range_variance": np.log(range_spread_m(after, law) / range_spread_m(before, law)),
        "intensity_variance": np.log(intensity_spread(after, law) / intensity_spread(before, law)),
        "drop": after.seen - before.seen,
    }
    return {name: values for name, values in found.items() if np.any(np.abs(values) > 1e-12)}


def dispersion(sample: Sample, fit: Fit) -> tuple[float, float]:
    """By how much ranges and rises scatter more than is stated, at least 1 (McCullagh and Nelder 1989, § 9.2).

    Heavy tails hardly pull where everything is far off; beside the scatter that there is, it does. The median of the
    residuals' sizes tells of it.
    """

    def of(z: np.ndarray, weight: np.ndarray) -> float:
        used = weight > 0
        if not used.any():
            return 1.0
        size, share = np.abs(z[used]), weight[used]
        order = np.argsort(size)
        below = np.cumsum(share[order])
        return max(float(size[order][np.searchsorted(below, 0.5 * below[-1])]) / sample.settings.law.median_size, 1.0)

    return of(fit.range_z, sample.share * fit.matched), of(fit.rise_z, sample.share * sample.returned)


def _spread_excess(gap: np.ndarray, law: Law) -> np.ndarray:
    """Above 0 where neighbours scatter more than stated, 0 on average for any law of the stated standard deviation."""
    return np.minimum(gap**2, law.most_squared) - 1

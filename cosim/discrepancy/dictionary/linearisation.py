"""Scores and information of every beam about a fitted model, for each channel of its likelihood.

For a change Δ of a predicted quantity a beam adds `score`·Δ to the log-likelihood and takes ½ `information`·Δ² from it.
Spurious returns are mixture directions: mixing in a share π of returns with density p₁ changes the likelihood p₀ to
p₀ + π(p₁ − p₀). The score is taken at a small reference share, and its unit is that share, so that score and
information are differences of counts: observed minus expected events, and expected events.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.inference.dependence import (
    ANGLES,
    SPURIOUS,
    angle_derivatives,
    spurious_densities,
)
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.likelihood import Residuals, residuals_of, stated_intensity_spread
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.projection import Projector
from cosim.discrepancy.inference.score import Evidence, Quantity, dispersion
from cosim.discrepancy.sampling.sample import Prediction, Sample

Scores = dict[Quantity, np.ndarray]


@dataclass(frozen=True, eq=False)
class LinearisedChannel:
    """A channel: a way in which the prediction of a beam can change.

    Attributes:
        name: name as in `diagnose --json`.
        quantity: quantity whose score and information apply.
        slope: (n,) change of the quantity per unit of the channel.
        one_sided: whether only a positive change makes sense.
    """

    name: str
    quantity: Quantity
    slope: np.ndarray
    one_sided: bool = False


@dataclass(frozen=True, eq=False)
class Linearisation:
    """A fitted model and its derivatives.

    Attributes:
        fitter, fitted: sample and fit.
        frames: traced frames of the sample.
        adjusted: prediction with random effects.
        evidence: score and information (n,) by quantity.
        channels: channels by name.
        mixed: linear mixed model with the random effects and all fitted parameters.
    """

    fitter: Fitter
    fitted: Fitted
    frames: tuple[TracedFrame, ...]
    adjusted: Prediction
    evidence: Evidence
    channels: dict[str, LinearisedChannel]
    mixed: LinearModel

    @property
    def sample(self) -> Sample:
        """Sample of beams."""
        return self.fitter.sample

    def projector(self, sectors: int, family: str = "range") -> Projector:
        """Projector for efficient scores, with this number of sectors of each scan as clusters.

        Args:
            sectors: number of sectors.
            family: of the tested channels; errors of positions have larger clusters, see `RandomEffects.clusters_of`.
        """
        clusters = self.fitter.random.clusters_of(family == "range", sectors)
        is_flat = self.sample.of_own_map  # flat priors do not inform about a mean of random effects
        least_left = 0.0 if is_flat else self.sample.settings.selection.least_left
        return Projector(self.mixed, self.fitted.estimate, clusters, self.sample.share, least_left)

    def weights(self, channel: str) -> tuple[np.ndarray, np.ndarray]:
        """Score and information (n,) per unit of one channel."""
        of = self.channels[channel]
        score, information = self.evidence.score[of.quantity], self.evidence.information[of.quantity]
        return score * of.slope, information * of.slope**2


def linearise(fitter: Fitter, fitted: Fitted, frames: tuple[TracedFrame, ...]) -> Linearisation:
    """Compute the derivatives of a fitted model.

    Args:
        fitter, fitted: sample and fit.
        frames: traced frames of the sample, for the surfaces next to a beam.
    """
    sample, random = fitter.sample, fitter.random
    adjusted = random.adjusted(fitted.prediction, fitted.estimate)
    residuals = residuals_of(sample, adjusted)
    wider = dispersion(sample, residuals)
    evidence_of_sample = Evidence.of(sample, residuals, wider=wider)
    score, information = dict(evidence_of_sample.score), dict(evidence_of_sample.information)
    # Losses next to the sky are confounded with the position of the edge.
    score["drop"] = np.where(sample.beside_sky, 0.0, score["drop"])
    information["drop"] = np.where(sample.beside_sky, 0.0, information["drop"])
    if sample.has_intensity:
        _score_intensity_variance(sample, residuals, adjusted, score, information)
    bent = any(dependence.channel in ANGLES for dependence in fitted.dependences)
    if not sample.of_own_map:  # returns from what is not in the map look like spurious ones
        _score_spurious(sample, adjusted, residuals.outcome, frames, bent, score, information)
    evidence = Evidence(score, information)
    mixed = LinearModel.of(random, fitted.columns, evidence, fitted.prediction, fitted.estimate)
    return Linearisation(fitter, fitted, frames, adjusted, evidence, _channels(sample, adjusted), mixed)


def seen_derivative(sample: Sample, adjusted: Prediction) -> np.ndarray:
    """Derivative (n,) of the probability of a return with respect to its logarithm, for errors of returns.

    0 at edges where the signal decides: the probability depends on the share of the footprint that the surface fills,
    so that a loss says where the edge is and not that returns are lost.
    """
    return np.where(sample.edge & (adjusted.log_odds_by_reflectance() != 0), 0.0, adjusted.seen)


def _channels(sample: Sample, adjusted: Prediction) -> dict[str, LinearisedChannel]:
    ones, angles = np.ones(len(sample)), angle_derivatives(sample)
    channels = [
        LinearisedChannel("range", "range", ones),
        *(LinearisedChannel(name, "range", angles[name]) for name in ANGLES),
        LinearisedChannel("drop", "drop", seen_derivative(sample, adjusted)),
        LinearisedChannel("range_variance", "range_variance", ones),
    ]
    if not sample.of_own_map:
        channels += [LinearisedChannel(name, name, ones, one_sided=True) for name in SPURIOUS]
    if sample.has_intensity:
        channels += [
            LinearisedChannel("intensity", "intensity", adjusted.intensity),
            LinearisedChannel("intensity_offset", "intensity", ones),
            LinearisedChannel("intensity_variance", "intensity_variance", _sensor_share(adjusted)),
        ]
    return {channel.name: channel for channel in channels}


def _sensor_share(adjusted: Prediction) -> np.ndarray:
    """Derivative (n,) of the logarithm of the σ of intensities by that of the sensor's part of it."""
    own = stated_intensity_spread(adjusted)
    return np.divide(adjusted.intensity_sigma**2, own**2, out=np.ones(len(own)), where=own > 0)


def _score_intensity_variance(
    sample: Sample, residuals: Residuals, adjusted: Prediction, score: Scores, information: Scores
) -> None:
    """Score the intensity variance relative to the sensor's own σ, without the minimum σ of the likelihood."""
    floor = 1.5 * sample.settings.likelihood.intensity_floor
    own = stated_intensity_spread(adjusted)
    z = residuals.intensity_z * residuals.intensity_sigma / np.maximum(own, 1e-9)
    pair = np.maximum(sample.partner, 0)
    gap = (z - z[pair]) / np.sqrt(2)
    known = np.where((own > floor) & (own[pair] > floor), information["intensity_variance"], 0.0)
    information["intensity_variance"] = known
    score["intensity_variance"] = known / 2 * (np.minimum(gap**2, sample.settings.likelihood.most_squared) - 1)


def _score_spurious(
    sample: Sample,
    adjusted: Prediction,
    outcome: np.ndarray,
    frames: tuple[TracedFrame, ...],
    bent: bool,
    score: Scores,
    information: Scores,
) -> None:
    """Add scores of spurious returns (mixture directions); at edges only if no beam nearby has such a range.

    At edges as many returns are expected before both surfaces as there are far behind both, and the reverse: this share
    is the reference share there.
    """
    constants, reference = sample.settings.likelihood, sample.settings.likelihood.reference_share
    nearest_m, farthest_m = sample.sides_at(adjusted.range_m)
    surface = np.where(sample.edge, nearest_m, np.nan_to_num(adjusted.range_m))
    behind = np.where(sample.edge, farthest_m, np.nan_to_num(adjusted.range_m))
    density = spurious_densities(sample, replace(adjusted, range_m=np.where(sample.edge, surface, adjusted.range_m)))
    outside = sample.outside_sides(np.stack([surface, behind]))
    explained = _explained_nearby(sample, frames) if bent else sample.surface_nearby
    first = sample.compared & sample.first
    clear, edge = first & ~sample.edge, first & sample.edge & np.isfinite(surface)
    hidden = explained if bent else np.zeros(len(sample), bool)  # deflected beams hit neighbouring surfaces
    likelihood = np.exp(outcome)
    measured = np.nan_to_num(sample.along_m)
    gap = measured - surface
    edge_gap = np.where(measured > behind, measured - behind, np.minimum(gap, 0.0))
    far = sample.returned & ~explained
    at_edges: Scores = {
        "early": outside[0] * density["early"],
        "late": outside[1] * np.exp(-np.clip(measured - behind, 0, 50)),
        "spurious": (outside[0] | outside[1]) / constants.reach_m,
    }
    for name in SPURIOUS:
        solid = np.ones(len(sample), bool) if name == "spurious" else np.isfinite(adjusted.range_m) & (surface > 1)
        present = constants.least_spurious_share + adjusted.spurious_per_m * constants.reach_m + adjusted.spurious_share
        share = sample.share
        used = share * (clear & solid)
        background = _background_share(share, clear, far, gap, name) if bent else 0.0
        ratio = (
            np.where(hidden, 0.0, density[name]) / np.maximum(likelihood + background / constants.reach_m, 1e-12) - 1
        )
        score[name] = reference * used * ratio / (1 + reference * ratio)
        information[name] = used * (reference**2 / (reference + present) if not background else reference + background)
        if not edge.any():
            continue
        usual = max(_background_share(share, edge, far, edge_gap, name), reference)
        ratio, used = at_edges[name] / np.maximum(likelihood, 1e-12) - 1, share * edge
        score[name] = score[name] + usual * used * ratio / (1 + usual * ratio)
        information[name] = information[name] + used * usual


def _background_share(share: np.ndarray, used: np.ndarray, far: np.ndarray, gap: np.ndarray, name: str) -> float:
    """Share of beams with a return on the opposite side of the surface, more than 1 m from it."""
    whole = max(float(share[used].sum()), 1.0)
    before = float(share[used & far & (gap < -1)].sum()) / whole
    behind = float(share[used & far & (gap > 1)].sum()) / whole
    return {"early": behind, "late": before}.get(name, min(before, behind))


def _explained_nearby(sample: Sample, frames: tuple[TracedFrame, ...]) -> np.ndarray:
    """(n,) bool returns for which the twin has a surface at the same range within a few rings and firings."""
    found = np.zeros(len(sample), bool)
    for number, frame in enumerate(frames):
        rows = np.flatnonzero((sample.frame == number) & sample.first & sample.returned)
        found[rows] = frame.has_surface_nearby(sample.beam[rows], sample.along_m[rows])
    return found

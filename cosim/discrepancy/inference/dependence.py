"""Dependences: changes of one channel that are linear in basis functions of covariates.

A dependence changes what the effects predict, beam by beam, before the random effects act. Each channel has its own
rule (`apply_changes`); a beam that points elsewhere by a small angle δ meets the same plane at R + dδ/(1 − dδ/R), where
d is the derivative of the range with respect to the angle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.inference.likelihood import unshared_spread_m
from cosim.discrepancy.inference.score import Quantity, SparseMatrix, change
from cosim.discrepancy.sampling.sample import Prediction, Sample
from cosim.discrepancy.settings import LikelihoodConstants

ANGLES = ("azimuth_error", "elevation_error")
SPURIOUS = ("spurious", "early", "late")
SPREADS = ("range_variance", "intensity_variance")
MEANS = ("range", *ANGLES, "intensity", "intensity_offset", "drop")

# Steps of one-sided differences; downwards for `drop`, because a beam that always returns cannot return more often.
_STEPS = {"range": 1e-4, "azimuth_error": 1e-6, "elevation_error": 1e-6, "intensity": 1e-3, "intensity_offset": 1e-4,
          "drop": -1e-3, "range_variance": 1e-2, "intensity_variance": 1e-2}  # fmt: skip
_MOST_LOG, _MOST_SHARE, _DARKEST = 3.0, 0.95, 0.01


@dataclass(frozen=True, eq=False)
class Dependence:
    """A fitted dependence of one channel.

    Attributes:
        name: `CHANNEL by COVARIATE`.
        channel: which part of the prediction changes, see `apply_changes`.
        basis: (n, k) basis functions at each beam of a sample.
        coefficients: (k,) in the channel's unit.
    """

    name: str
    channel: str
    basis: SparseMatrix
    coefficients: np.ndarray

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return self.basis.shape[1]

    @property
    def values(self) -> np.ndarray:
        """(n,) change of the channel at each beam."""
        return self.basis @ self.coefficients

    @property
    def is_one_sided(self) -> bool:
        """Whether only positive coefficients make sense: shares of spurious returns."""
        return self.channel in SPURIOUS


def angle_derivatives(sample: Sample) -> dict[str, np.ndarray]:
    """Change of range (n,) per radian of azimuth (counter-clockwise) and elevation (upwards) error [m/rad].

    Beams at so flat an angle that the range is far from linear in it get 0.
    """
    turn, most = sample.pose_derivative[:, 3:], sample.settings.likelihood.steepest_m_per_rad
    derivatives = {
        "azimuth_error": turn[:, 2],
        "elevation_error": turn[:, 0] * np.sin(sample.azimuth) - turn[:, 1] * np.cos(sample.azimuth),
    }
    return {name: np.where(np.abs(values) < most, values, 0.0) for name, values in derivatives.items()}


def spurious_densities(sample: Sample, expected: Prediction) -> dict[str, np.ndarray]:
    """Probability density [1/m] (n,) of a spurious return of each kind at the measured range.

    Uniform over the sensor's reach; uniform before the surface; exponential with a scale of 1 m behind it.
    """
    solid = np.isfinite(expected.range_m) & (expected.range_m > 1)
    gap = np.nan_to_num(sample.along_m) - np.nan_to_num(expected.range_m)
    returned = sample.returned
    return {
        "spurious": np.where(returned, 1 / sample.settings.likelihood.reach_m, 0.0),
        "early": np.where(returned & solid & (gap < 0), 1 / np.maximum(np.nan_to_num(expected.range_m), 1.0), 0.0),
        "late": np.where(returned & solid & (gap > 0), np.exp(-np.maximum(gap, 0.0)), 0.0),
    }


def apply_changes(sample: Sample, before: Prediction, changes: Mapping[str, np.ndarray]) -> Prediction:
    """The prediction with changes (n,) by channel.

    Channels: `range` [m]; `azimuth_error`, `elevation_error` [rad] of the true beam against the reported one;
    `intensity` (log of the factor); `intensity_offset`; `drop` (relative change of the probability of a return);
    `range_variance`, `intensity_variance` (change of log σ of the sensor); `spurious`, `early`, `late` (share of
    beams that return from elsewhere).
    """
    after, constants = before, sample.settings.likelihood
    if any(name in changes for name in ANGLES):
        derivatives = angle_derivatives(sample)
        shift = sum(derivatives[name] * changes[name] for name in ANGLES if name in changes)
        after = replace(after, range_m=_bent(after.range_m, np.asarray(shift)))
    if "range" in changes:
        after = replace(after, range_m=after.range_m + changes["range"])
    if "intensity" in changes or "intensity_offset" in changes:
        factor = np.exp(np.clip(changes.get("intensity", 0.0), -_MOST_LOG, _MOST_LOG))
        intensity = np.maximum(after.intensity * factor + changes.get("intensity_offset", 0.0), 0.0)
        ratio = np.where(after.intensity > _DARKEST, intensity / np.maximum(after.intensity, _DARKEST), 1.0)
        ratio = np.clip(ratio, np.exp(-_MOST_LOG), np.exp(_MOST_LOG))
        after = replace(after, intensity=intensity, intensity_sigma=after.intensity_sigma * ratio)
    if "drop" in changes:
        seen = np.clip(after.seen * (1 + changes["drop"]), 0, 1)
        after = replace(after, seen=seen, silent=np.clip(after.silent + after.seen - seen, 0, 1))
    if "range_variance" in changes:
        after = replace(after, range_sigma_m=_scaled_sigma(after, changes["range_variance"], constants))
    if "intensity_variance" in changes:
        factor = np.exp(np.clip(changes["intensity_variance"], -_MOST_LOG, _MOST_LOG))
        sigma = np.maximum(after.intensity_sigma, constants.intensity_floor)
        after = replace(after, intensity_sigma=np.where(factor == 1, after.intensity_sigma, sigma * factor))
    shares = {name: np.clip(changes[name], 0, _MOST_SHARE) for name in SPURIOUS if name in changes}
    if shares:
        density = spurious_densities(sample, after)
        surfaces = 1 - np.prod([1 - share for share in shares.values()], axis=0)
        elsewhere = sum((share * density[name] for name, share in shares.items()), np.zeros(len(sample)))
        after = replace(after, spurious_share=surfaces, spurious=elsewhere)
    return after


def changes_of(dependences: Sequence[Dependence]) -> dict[str, np.ndarray]:
    """The sum (n,) of dependences by channel."""
    total: dict[str, np.ndarray] = {}
    for dependence in dependences:
        values = dependence.values
        total[dependence.channel] = total[dependence.channel] + values if dependence.channel in total else values
    return total


def channel_slopes(
    sample: Sample, before: Prediction, changes: Mapping[str, np.ndarray], channels: Sequence[str]
) -> dict[str, dict[Quantity, np.ndarray]]:
    """Derivatives (n,) of each quantity with respect to the change of each channel, at the present changes.

    Spurious channels have none: they are fitted by expectation maximisation.
    """
    at, slopes = apply_changes(sample, before, changes), {}
    for name in dict.fromkeys(channels):
        if name in SPURIOUS:
            continue
        step = _STEPS[name]
        moved = apply_changes(sample, before, {**changes, name: changes.get(name, np.zeros(len(sample))) + step})
        slopes[name] = {key: values / step for key, values in change(sample, at, moved).items()}
    return slopes


def moved_dependences(dependences: Sequence[Dependence], step: np.ndarray) -> tuple[Dependence, ...]:
    """Add a step (c,) to the coefficients of all dependences; shares of spurious returns are fitted elsewhere."""
    moved, start = [], 0
    for dependence in dependences:
        part = 0.0 if dependence.is_one_sided else step[start : start + dependence.size]
        moved.append(replace(dependence, coefficients=dependence.coefficients + part))
        start += dependence.size
    return tuple(moved)


def updated_spurious_shares(
    sample: Sample, expected: Prediction, per_density: np.ndarray, dependences: Sequence[Dependence]
) -> tuple[Dependence, ...]:
    """Update the shares of spurious returns by one step of expectation maximisation, up to the largest share.

    Args:
        sample: of beams.
        expected: prediction with the dependences.
        per_density: (n,) increase of each beam's log-likelihood per density of a spurious return.
        dependences: of which the one-sided ones are updated.
    """
    share, density = sample.share * sample.compared * sample.first, spurious_densities(sample, expected)
    least = sample.settings.likelihood.least_spurious_share
    updated = []
    for dependence in dependences:
        if dependence.is_one_sided:
            start = np.where(dependence.coefficients > 0, dependence.coefficients, least)
            new = dependence.basis.T @ (share * density[dependence.channel] * per_density)
            start = start * new / np.maximum(dependence.basis.T @ share, 1e-9)
            dependence = replace(dependence, coefficients=np.minimum(start, _MOST_SHARE))
        updated.append(dependence)
    return tuple(updated)


def _bent(range_m: np.ndarray, shift_m: np.ndarray) -> np.ndarray:
    """Ranges (n,) of beams turned so that they would move by `shift_m` (n,) in linear approximation."""
    ratio = shift_m / np.maximum(np.nan_to_num(range_m), 0.5)
    moved = shift_m / (1 - np.clip(ratio, -1.0, 0.5))
    return range_m + np.where(np.abs(ratio) <= 1, moved, 0.0)


def _scaled_sigma(expected: Prediction, log_change: np.ndarray, constants: LikelihoodConstants) -> np.ndarray:
    """The sensor's σ of ranges (n,) [m] with which the spread between neighbours changes by exp(log_change)."""
    whole = unshared_spread_m(expected, constants) ** 2
    other = whole - expected.range_sigma_m**2
    variance = whole * np.exp(2 * np.clip(log_change, -_MOST_LOG, _MOST_LOG)) - other
    return np.sqrt(np.maximum(variance, 1e-8))

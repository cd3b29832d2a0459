"""Effects by channel: errors of beams, returns and scans as functions of covariates.

A channel is a way in which a beam's measurement can change, named as in `cosim diagnose --json`. Each class below turns
`error`, a function of covariates that a subclass defines, into the model of its channel for simulation and for expected
values. Plug-ins that `cosim diagnose` writes derive from them; so may a user's own effects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import (
    BeamEffect,
    DetectionEffect,
    Effect,
    NoiseScaleEffect,
    PointEffect,
    ScanEffect,
)
from sensors.effects.covariates import COVARIATES, Categories, Values, covariate_values, neighbour_is
from sensors.effects.phases import Channel
from sensors.returns import Returns
from sensors.shot import Shot

_CHAINS = {"previous_lost": (1, False), "above_lost": (0, False), "below_lost": (0, True)}
_MOST_SHARE = 0.95
_MOST_LOG = 3.0
_BRIGHTEST = 0.1  # spurious returns are dim, as of `false_alarms`
_LATE_M = 1.0


class ErrorByCovariates(Effect):
    """An effect whose size is a function of covariates.

    Class attributes:
        covariates: their names, see `sensors.effects.covariates`.
    """

    covariates: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        """Derive from the covariates what the effect needs.

        Raises:
            ValueError: an unknown covariate.
        """
        super().__pydantic_init_subclass__(**kwargs)
        unknown = [name for name in cls.covariates if name not in COVARIATES]
        if unknown:
            raise ValueError(f"covariate {unknown[0]!r} is unknown; choose one of {', '.join(COVARIATES)}")
        used = [COVARIATES[name] for name in cls.covariates]
        cls.needs_new_rays = cls.needs_new_rays or any(covariate.of_world for covariate in used)
        if issubclass(cls, BeamEffect):
            cls.needs_surfaces = any(covariate.of_surface for covariate in used)

    def error(self, *values: Any) -> np.ndarray:
        """Return the error (m,) in the channel's unit at values of the covariates, each (m,) or `Categories`."""
        raise NotImplementedError

    def errors(
        self, returns: Returns, shot: Shot, among: Returns | None = None, fixed: Mapping[str, Values] | None = None
    ) -> np.ndarray:
        """Return the error (m,) of each return; 0 where a covariate is not known.

        Args:
            returns: m rows.
            shot: of the revolution.
            among: returns among which neighbours are looked up; by default `returns`.
            fixed: values of covariates that are given instead of computed, by name.

        Raises:
            ValueError: `error` gives another shape or NaN.
        """
        if not all(COVARIATES[name].is_simulated for name in self.covariates):
            return np.zeros(len(returns))
        values = [
            fixed[name] if fixed and name in fixed else covariate_values(name, returns, shot, among)
            for name in self.covariates
        ]
        known = np.ones(len(returns), bool)
        for value in values:
            known &= value.is_known if isinstance(value, Categories) else np.isfinite(value)
        with np.errstate(all="ignore"):  # of values that are not known
            found = np.asarray(self.error(*values), float)
        if found.shape not in ((), known.shape):
            raise ValueError(f"error has shape {found.shape}; give {known.shape}")
        found = np.where(known, found, 0.0)
        if not np.isfinite(found).all():
            raise ValueError("error gave NaN or infinity; keep it finite")
        return found


class _AngleError(ErrorByCovariates, BeamEffect):
    """An error of the beams' direction; the surfaces in its covariates are those of the beams without it."""

    also: ClassVar[tuple[Channel, ...]] = ("range",)

    def angles(self, shot: Shot) -> np.ndarray:
        """Return the error (n,) of each beam [rad]; 0 for covariates of signals, which do not exist yet."""
        if any(COVARIATES[name].of_signal for name in self.covariates):
            return np.zeros(len(shot.rays))
        return self.errors(shot.every_beam, shot)


class AzimuthError(_AngleError):
    """True azimuth = reported + error [rad], counter-clockwise."""

    channel: ClassVar[Channel] = "azimuth_error"

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return the beams, turned about the sensor's axis."""
        return beams.turned(self.angles(shot))


class ElevationError(_AngleError):
    """True elevation = reported + error [rad]."""

    channel: ClassVar[Channel] = "elevation_error"

    def apply(self, beams: Beams, shot: Shot, rng: np.random.Generator) -> Beams:
        """Return the beams, raised in their vertical planes."""
        return beams.raised(self.angles(shot))


class RangeError(ErrorByCovariates, PointEffect):
    """R + error [m]."""

    channel: ClassVar[Channel] = "range"

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns with other ranges."""
        return replace(returns, range_m=returns.range_m + self.errors(returns, shot).astype(np.float32))


class IntensityFactor(ErrorByCovariates, PointEffect):
    """I·exp(error): for small errors their share of the intensity."""

    channel: ClassVar[Channel] = "intensity"

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns with intensities multiplied."""
        factor = np.exp(np.clip(self.errors(returns, shot), -_MOST_LOG, _MOST_LOG))
        return replace(returns, intensity=returns.intensity * factor.astype(np.float32))


class IntensityOffset(ErrorByCovariates, PointEffect):
    """I + error."""

    channel: ClassVar[Channel] = "intensity_offset"

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns with shifted intensities."""
        return replace(returns, intensity=returns.intensity + self.errors(returns, shot).astype(np.float32))


class ReturnProbability(ErrorByCovariates, DetectionEffect):
    """P(return)·(1 + error), within 0–1: an error below 0 loses returns; what is lost before stays lost."""

    channel: ClassVar[Channel] = "drop"

    def kept(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability (m,) of each return to be noticed."""
        return np.clip(1 + self.errors(returns, shot), 0, 1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns that are noticed; losses that depend on a neighbour's loss are drawn in order."""
        chain = [name for name in self.covariates if name in _CHAINS]
        is_grid = len(shot.rays) == shot.pattern.rings * shot.pattern.firings
        if len(chain) != 1 or not is_grid or shot.measured is not None:
            return super().apply(returns, shot, rng)
        drawn = shot.per_return(returns, rng.random((2, len(shot.rays))))
        if_seen, if_lost = (
            drawn < np.clip(1 + self.errors(returns, shot, fixed={chain[0]: neighbour_is(lost, len(returns))}), 0, 1)
            for lost in (False, True)
        )
        return returns.take(_chained(if_seen, if_lost, returns, shot, chain[0]))


def _chained(if_seen: np.ndarray, if_lost: np.ndarray, returns: Returns, shot: Shot, neighbour: str) -> np.ndarray:
    """(m,) bool returns that are detected, if detection depends on the loss of a neighbouring beam.

    Args:
        if_seen, if_lost: (m,) bool, whether each return is noticed if its neighbour is seen, or lost.
        returns: m rows; second returns share the fate of the first.
        shot: whose beams are a grid of rings and firings.
        neighbour: the name of the covariate.
    """
    shape, first = (shot.pattern.rings, shot.pattern.firings), returns.return_no == 0
    seen, lost = np.zeros(shape, bool), np.zeros(shape, bool)
    seen.flat[returns.beam[first]], lost.flat[returns.beam[first]] = if_seen[first], if_lost[first]
    exists = shot.hits.solid.exists.reshape(shape)
    axis, is_reversed = _CHAINS[neighbour]
    if axis:
        seen, lost, exists = seen.T, lost.T, exists.T
    noticed, before = np.zeros(seen.shape, bool), np.zeros(seen.shape[1], bool)
    for step in reversed(range(len(seen))) if is_reversed else range(len(seen)):
        noticed[step] = np.where(before, lost[step], seen[step])
        before = exists[step] & ~noticed[step]
    return (noticed.T if axis else noticed).ravel()[returns.beam]


class RangeSpread(ErrorByCovariates, NoiseScaleEffect):
    """σ·exp(error) of the sensor's noise of range."""

    channel: ClassVar[Channel] = "range_variance"

    def factors(self, returns: Returns, shot: Shot) -> tuple[np.ndarray, float]:
        """Return the factor (m,) of the range's noise."""
        return np.exp(np.clip(self.errors(returns, shot), -_MOST_LOG, _MOST_LOG)), 1.0


class IntensitySpread(ErrorByCovariates, NoiseScaleEffect):
    """σ·exp(error) of the sensor's noise of intensity."""

    channel: ClassVar[Channel] = "intensity_variance"

    def factors(self, returns: Returns, shot: Shot) -> tuple[float, np.ndarray]:
        """Return the factor (m,) of the intensity's noise."""
        return 1.0, np.exp(np.clip(self.errors(returns, shot), -_MOST_LOG, _MOST_LOG))


class _SpuriousReturns(ErrorByCovariates, ScanEffect):
    """With probability `error` a beam reports a return from elsewhere instead of what it would report otherwise."""

    also: ClassVar[tuple[Channel, ...]] = ("drop", "range", "intensity")

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns with spurious ones among them; their intensity is uniform in 0–0.1."""
        drawn, where, brightness = rng.random((3, len(shot.rays)))
        beam = np.flatnonzero(drawn < self._shares(shot, returns))
        spurious = Returns.spurious(beam, self._ranges(where, shot)[beam], _BRIGHTEST * brightness[beam])
        return returns.replacing_beams(spurious)

    def survival(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the probability (m,) of each return not to be replaced."""
        return 1 - self._shares(shot, returns)[returns.beam]

    def silence(self, shot: Shot) -> np.ndarray:
        """Return the probability (n,) of each beam to report nothing from elsewhere."""
        return 1 - self._shares(shot, shot.noiseless)

    def density(self, beam: np.ndarray, range_m: np.ndarray, shot: Shot) -> np.ndarray:
        """Return the probability (k,) per metre of a spurious return at each range."""
        return self._shares(shot, shot.noiseless)[beam] * self._density(range_m, shot, self._free_path(shot)[beam])

    def _shares(self, shot: Shot, among: Returns | None) -> np.ndarray:
        """Probability (n,) of each beam."""
        return np.clip(self.errors(shot.every_beam, shot, among), 0, _MOST_SHARE)

    def _free_path(self, shot: Shot) -> np.ndarray:
        """Range (n,) [m] of the surface that each beam meets; inf where there is none."""
        return np.where(shot.hits.solid.exists, shot.hits.solid.range_m, np.inf).astype(float)

    def _ranges(self, uniform: np.ndarray, shot: Shot) -> np.ndarray:
        """Ranges (n,) [m] of spurious returns from uniform numbers (n,)."""
        raise NotImplementedError

    def _density(self, range_m: np.ndarray, shot: Shot, free_m: np.ndarray) -> np.ndarray:
        """Probability (k,) per metre at each range, of a spurious return before or behind a surface at `free_m`."""
        raise NotImplementedError


class UniformReturns(_SpuriousReturns):
    """A share `error` of beams returns from anywhere: uniform over the measurable ranges."""

    channel: ClassVar[Channel] = "spurious"

    def _ranges(self, uniform: np.ndarray, shot: Shot) -> np.ndarray:
        near, far = shot.pattern.range_m
        return near + (far - near) * uniform

    def _density(self, range_m: np.ndarray, shot: Shot, free_m: np.ndarray) -> np.ndarray:
        near, far = shot.pattern.range_m
        return ((range_m >= near) & (range_m <= far)) / (far - near)


class EarlyReturns(_SpuriousReturns):
    """A share `error` of beams returns from before the surface that they meet: uniform from 0 to its range."""

    channel: ClassVar[Channel] = "early"

    def _shares(self, shot: Shot, among: Returns | None) -> np.ndarray:
        return np.where(shot.hits.solid.exists, super()._shares(shot, among), 0.0)

    def _ranges(self, uniform: np.ndarray, shot: Shot) -> np.ndarray:
        return self._free_path(shot) * np.maximum(uniform, 1e-6)

    def _density(self, range_m: np.ndarray, shot: Shot, free_m: np.ndarray) -> np.ndarray:
        return ((range_m > 0) & (range_m < free_m)) / np.maximum(free_m, 1e-6)


class LateReturns(_SpuriousReturns):
    """A share `error` of beams returns from behind the surface that they meet: exponential, 1 m on average."""

    channel: ClassVar[Channel] = "late"

    def _shares(self, shot: Shot, among: Returns | None) -> np.ndarray:
        return np.where(shot.hits.solid.exists, super()._shares(shot, among), 0.0)

    def _ranges(self, uniform: np.ndarray, shot: Shot) -> np.ndarray:
        return self._free_path(shot) - _LATE_M * np.log1p(-uniform)

    def _density(self, range_m: np.ndarray, shot: Shot, free_m: np.ndarray) -> np.ndarray:
        gap = range_m - free_m
        return np.where(gap > 0, np.exp(-np.maximum(gap, 0) / _LATE_M) / _LATE_M, 0.0)

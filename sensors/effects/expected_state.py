"""State of the beams' expectation between two effects of a sensor model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import singledispatch

import numpy as np

from sensors.effects.acting import check_returns
from sensors.effects.base import (
    EchoEffect,
    Effect,
    NoiseEffect,
    NoiseScaleEffect,
    PointEffect,
    RoundingEffect,
    ScanEffect,
)
from sensors.effects.blame import blamed, check_values
from sensors.effects.phases import CLIP_BEFORE
from sensors.effects.rounding import rounded
from sensors.returns import Returns
from sensors.shot import Shot

_DRAWS = 8


@dataclass(frozen=True, eq=False)
class ExpectedState:
    """Expectation of n beams after some of a sensor's effects. Its arrays are never changed in place.

    Attributes:
        returns: mean returns.
        seen: (n,) probability that the surface's return is reported, of beams that have one.
        elsewhere: (n,) probability that another part of the footprint, or a mirrored surface, is reported instead.
        silent: (n,) probability that nothing is reported; None before the first scan effect.
        variance: (2, n) of ranges [m²] and intensities.
        noise: (2, n) the part of the variances that noise effects added.
        noiseless: see `Shot.noiseless`.
        clips: number of limits of the intensity in `CLIP_BEFORE` that have been applied.
    """

    returns: Returns
    seen: np.ndarray
    elsewhere: np.ndarray
    silent: np.ndarray | None
    variance: np.ndarray
    noise: np.ndarray
    noiseless: Returns | None = None
    clips: int = 0

    @classmethod
    def of(cls, shot: Shot, reflectance_factor: float) -> ExpectedState:
        """State before any effect; `reflectance_factor` multiplies the reflectances of all solid surfaces."""
        beams, returns = len(shot.rays), shot.solids
        if reflectance_factor != 1:
            factor = np.float32(reflectance_factor)
            returns = replace(returns, intensity=returns.intensity * factor, reflectance=returns.reflectance * factor)
        return cls(returns, np.ones(beams), np.zeros(beams), None, np.zeros((2, beams)), np.zeros((2, beams)))

    def after(self, effect: Effect, shot: Shot, twin_variance: np.ndarray) -> ExpectedState:
        """State after one more effect; `twin_variance` (2, n) of the twin's ranges [m²] and reflectances.

        Raises:
            SensorError: a user's effect raises an error, or gives arrays of wrong shape or values.
        """
        state = self
        while state.clips < len(CLIP_BEFORE) and effect.phase >= CLIP_BEFORE[state.clips]:
            clipped = replace(state.returns, intensity=state.returns.intensity.clip(0, 1))
            state = replace(state, returns=clipped, clips=state.clips + 1)
        if state.noiseless is None and isinstance(effect, NoiseEffect | NoiseScaleEffect | ScanEffect):
            state = replace(state, noiseless=state.returns)
        shot.noiseless = state.noiseless
        return _after(effect, state, shot, twin_variance)

    def silence(self) -> np.ndarray:
        """Probability (n,) that nothing is reported."""
        return np.maximum(1 - self.answering() - self.elsewhere, 0) if self.silent is None else self.silent

    def answering(self) -> np.ndarray:
        """Probability (n,) that the surface's return is reported; 0 of beams that have none."""
        found = np.zeros(len(self.seen))
        found[self.returns.beam] = self.seen[self.returns.beam]
        return found


def _scaled(values: np.ndarray, beam: np.ndarray, factor: np.ndarray | float) -> np.ndarray:
    """Values (n,), those of `beam` (m,) multiplied by a factor (m,); the same array where nothing changes."""
    if not values.any() or np.all(np.equal(factor, 1)):
        return values
    changed = values.copy()
    changed[beam] *= factor
    return changed


def _raised(variance: np.ndarray, beam: np.ndarray, added: tuple[np.ndarray | float, np.ndarray | float]) -> np.ndarray:
    """Copy of variances (2, n), those of `beam` (m,) raised by variances (m,) of range and intensity."""
    changed = variance.copy()
    for row, values in zip(changed, added, strict=True):
        row[beam] += values
    return changed


@singledispatch
def _after(effect: Effect, state: ExpectedState, shot: Shot, twin_variance: np.ndarray) -> ExpectedState:
    """State after an effect; effects on beams have acted before."""
    return state


@_after.register
def _after_echo(effect: EchoEffect, state: ExpectedState, shot: Shot, twin_variance: np.ndarray) -> ExpectedState:
    with blamed(effect, ""):
        returns, chance = effect.expected(state.returns, shot)
    if effect.source:
        check_returns(effect, state.returns, returns, shot, "")
    check_values(effect, "kept", chance, len(returns), 0.0)
    first = returns.return_no == 0
    if not first.all():
        returns, chance = returns.take(first), chance[first]
    with blamed(effect, ""):
        others = effect.elsewhere(shot)
    check_values(effect, "elsewhere", others, len(state.seen), 0.0)
    if np.any(others):
        elsewhere = state.elsewhere + state.seen * others
    else:  # what is not detected of a surface is not detected of others either
        elsewhere = _scaled(state.elsewhere, returns.beam, chance)
    return replace(state, returns=returns, elsewhere=elsewhere, seen=_scaled(state.seen, returns.beam, chance))


@_after.register
def _after_points(effect: PointEffect, state: ExpectedState, shot: Shot, twin_variance: np.ndarray) -> ExpectedState:
    """Some point effects draw random numbers: their mean and spread follow from several draws."""
    rng = np.random.default_rng(0)
    before = rng.bit_generator.state
    with blamed(effect, ""):
        changed = effect.apply(state.returns, shot, rng)
    if effect.source:
        check_returns(effect, state.returns, changed, shot, "")
    if rng.bit_generator.state == before:  # it draws no random numbers
        return replace(state, returns=changed)
    draws = [effect.apply(state.returns, shot, np.random.default_rng(seed)) for seed in range(1, _DRAWS)]
    ranges = np.stack([changed.range_m, *(draw.range_m for draw in draws)])
    intensities = np.stack([changed.intensity, *(draw.intensity for draw in draws)])
    mean = replace(changed, range_m=ranges.mean(0), intensity=intensities.mean(0))
    added = ranges.var(0, ddof=1), intensities.var(0, ddof=1)
    return replace(state, returns=mean, variance=_raised(state.variance, state.returns.beam, added))


@_after.register
def _after_noise(effect: NoiseEffect, state: ExpectedState, shot: Shot, twin_variance: np.ndarray) -> ExpectedState:
    with blamed(effect, ""):
        sigmas = effect.spread(state.returns, shot)
    for values in sigmas:
        check_values(effect, "spread", values, len(state.returns), 0.0)
    variance = _raised(state.variance, state.returns.beam, (np.square(sigmas[0]), np.square(sigmas[1])))
    return replace(state, variance=variance, noise=state.noise + (variance - state.variance))


@_after.register
def _after_noise_scale(
    effect: NoiseScaleEffect, state: ExpectedState, shot: Shot, twin_variance: np.ndarray
) -> ExpectedState:
    beam = state.returns.beam
    with blamed(effect, ""):
        factors = effect.factors(state.returns, shot)
    for factor in factors:
        check_values(effect, "factors", factor, len(state.returns), 0.0)
    added = tuple(noise[beam] * (np.square(factor) - 1) for noise, factor in zip(state.noise, factors, strict=True))
    return replace(state, variance=_raised(state.variance, beam, added), noise=_raised(state.noise, beam, added))


@_after.register
def _after_rounding(
    effect: RoundingEffect, state: ExpectedState, shot: Shot, twin_variance: np.ndarray
) -> ExpectedState:
    """Rounding acts on the true values, which scatter about those of the twin."""
    beam = state.returns.beam
    of_twin = twin_variance[:, beam]
    true = np.sqrt(state.variance[:, beam] + of_twin)
    returns, spread = rounded(state.returns, effect, true[0], true[1])
    variance = state.variance.copy()
    variance[:, beam] = np.maximum(np.stack(spread) - of_twin, 0)
    return replace(state, returns=returns, variance=variance)


@_after.register
def _after_scan(effect: ScanEffect, state: ExpectedState, shot: Shot, twin_variance: np.ndarray) -> ExpectedState:
    silent, beam = state.silence(), state.returns.beam
    with blamed(effect, ""):
        kept = effect.survival(state.returns, shot)
    check_values(effect, "survival", kept, len(state.returns), 0.0)
    if type(effect).density is Effect.density:  # takes returns away and puts nothing in their place
        silent = silent.copy()
        silent[beam] += (state.seen + state.elsewhere)[beam] * (1 - kept)
    else:
        with blamed(effect, ""):
            quiet = effect.silence(shot)
        check_values(effect, "silence", quiet, len(state.seen), 0.0)
        silent = silent * quiet
    seen, elsewhere = _scaled(state.seen, beam, kept), _scaled(state.elsewhere, beam, kept)
    return replace(state, silent=silent, seen=seen, elsewhere=elsewhere)

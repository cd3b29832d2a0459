"""Expectation of every beam under a sensor model: means, standard deviations and probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
_LEAST_WEIGHT = 1e-9
_TEXTURES = 4  # realisations over which an unknown texture is averaged


@dataclass(frozen=True, eq=False)
class Expectation:
    """Expectation of n beams.

    Attributes:
        range_m: (n,) float64 mean range of the answering surface from the reported optical centre; NaN where none can.
        range_sigma_m: (n,) its standard deviation.
        intensity: (n,) mean intensity, 0–1.
        intensity_sigma: (n,) its standard deviation.
        seen: (n,) probability that the surface's return is reported; 0 where none can.
        silent: (n,) probability that nothing is reported at all.
        elsewhere: (n,) probability that another part of the footprint, or a mirrored surface, is reported instead.
    """

    range_m: np.ndarray
    range_sigma_m: np.ndarray
    intensity: np.ndarray
    intensity_sigma: np.ndarray
    seen: np.ndarray
    silent: np.ndarray
    elsewhere: np.ndarray


def expect(
    effects: Sequence[Effect],
    shot: Shot,
    twin_sigmas: tuple[np.ndarray, np.ndarray] | None = None,
    reflectance_factor: float = 1.0,
) -> Expectation:
    """Expectation of a traced shot under effects in the order in which they act.

    Where the texture of surfaces is unknown, this is the expectation over its realisations, and the standard deviations
    include the spread between them.

    Args:
        effects: of the sensor.
        shot: of n beams.
        twin_sigmas: (n,) each, standard deviations of the twin's ranges [m] and reflectances: rounding acts on the true
            values, not on those of the twin. The standard deviations of the expectation are only those of the sensor.
        reflectance_factor: of all solid surfaces, at most 1.
    """
    if shot.is_texture_known or not any(effect.has_texture for effect in effects):
        return _expect(effects, shot, twin_sigmas, reflectance_factor)
    shots = [shot.with_texture(number) for number in range(1, _TEXTURES + 1)]
    mixed = _mixture([_expect(effects, one, twin_sigmas, reflectance_factor) for one in shots])
    shot.noiseless = shots[0].noiseless
    return mixed


def _mixture(parts: Sequence[Expectation]) -> Expectation:
    """Expectation of a mixture of equally probable parts: means, and spreads within and between the parts."""
    seen = np.stack([part.seen for part in parts])
    weight = np.maximum(seen, _LEAST_WEIGHT)
    weight /= weight.sum(0)

    def moments(name: str, sigma: str) -> tuple[np.ndarray, np.ndarray]:
        values = np.stack([getattr(part, name) for part in parts])
        within = np.stack([getattr(part, sigma) for part in parts]) ** 2
        mean = (weight * values).sum(0)
        between = (weight * np.nan_to_num(values - mean) ** 2).sum(0) * len(parts) / (len(parts) - 1)
        return mean, np.sqrt((weight * within).sum(0) + between)

    range_m, range_sigma_m = moments("range_m", "range_sigma_m")
    intensity, intensity_sigma = moments("intensity", "intensity_sigma")
    return Expectation(
        range_m=range_m,
        range_sigma_m=range_sigma_m,
        intensity=intensity,
        intensity_sigma=intensity_sigma,
        seen=seen.mean(0),
        silent=np.mean([part.silent for part in parts], axis=0),
        elsewhere=np.mean([part.elsewhere for part in parts], axis=0),
    )


def _expect(
    effects: Sequence[Effect],
    shot: Shot,
    twin_sigmas: tuple[np.ndarray, np.ndarray] | None,
    reflectance_factor: float,
) -> Expectation:
    """Expectation of a traced shot for one texture; arguments as of `expect`."""
    beams = len(shot.rays)
    returns, shot.noiseless = shot.solids, None
    if reflectance_factor != 1:
        factor = np.float32(reflectance_factor)
        returns = replace(returns, intensity=returns.intensity * factor, reflectance=returns.reflectance * factor)
    seen, elsewhere, silent = np.ones(beams), np.zeros(beams), None
    range_variance, intensity_variance = np.zeros(beams), np.zeros(beams)
    noise = np.zeros((2, beams))  # the part of the variances that noise effects added
    of_twin = (np.zeros(beams),) * 2 if twin_sigmas is None else tuple(map(np.square, twin_sigmas))
    clips = list(CLIP_BEFORE)
    for effect in effects:
        while clips and effect.phase >= clips[0]:
            clips.pop(0)
            returns = replace(returns, intensity=returns.intensity.clip(0, 1))
        if shot.noiseless is None and isinstance(effect, NoiseEffect | NoiseScaleEffect | ScanEffect):
            shot.noiseless = returns
        if isinstance(effect, EchoEffect):
            returns, chance = _answer(effect, returns, shot)
            first = returns.return_no == 0
            if not first.all():
                returns, chance = returns.take(first), chance[first]
            with blamed(effect, ""):
                others = effect.elsewhere(shot)
            check_values(effect, "elsewhere", others, beams, 0.0)
            if np.any(others):
                elsewhere += seen * others
            else:  # what is not detected of a surface is not detected of others either
                elsewhere[returns.beam] *= chance
            seen[returns.beam] *= chance
        elif isinstance(effect, NoiseEffect):
            before = np.stack([range_variance, intensity_variance])
            with blamed(effect, ""):
                of_range, of_intensity = effect.spread(returns, shot)
            for values in (of_range, of_intensity):
                check_values(effect, "spread", values, len(returns), 0.0)
            range_variance[returns.beam] += np.square(of_range)
            intensity_variance[returns.beam] += np.square(of_intensity)
            noise += np.stack([range_variance, intensity_variance]) - before
        elif isinstance(effect, NoiseScaleEffect):
            with blamed(effect, ""):
                factors = effect.factors(returns, shot)
            for row, (variance, factor) in enumerate(zip((range_variance, intensity_variance), factors, strict=True)):
                check_values(effect, "factors", factor, len(returns), 0.0)
                change = noise[row, returns.beam] * (np.square(factor) - 1)
                variance[returns.beam] += change
                noise[row, returns.beam] += change
        elif isinstance(effect, RoundingEffect):
            beam = returns.beam
            extra_range, extra_intensity = (variance[beam] for variance in of_twin)
            true_range, true_intensity = range_variance[beam] + extra_range, intensity_variance[beam] + extra_intensity
            returns, spread = rounded(returns, effect, np.sqrt(true_range), np.sqrt(true_intensity))
            range_variance[beam] = np.maximum(spread[0] - extra_range, 0)
            intensity_variance[beam] = np.maximum(spread[1] - extra_intensity, 0)
        elif isinstance(effect, PointEffect):
            returns, spread = _mean_and_spread(effect, returns, shot)
            range_variance[returns.beam] += spread[0]
            intensity_variance[returns.beam] += spread[1]
        elif isinstance(effect, ScanEffect):
            silent = _silent(seen, returns, elsewhere) if silent is None else silent
            with blamed(effect, ""):
                kept = effect.survival(returns, shot)
            check_values(effect, "survival", kept, len(returns), 0.0)
            if type(effect).density is Effect.density:  # takes returns away and puts nothing in their place
                silent[returns.beam] += (seen + elsewhere)[returns.beam] * (1 - kept)
            else:
                with blamed(effect, ""):
                    quiet = effect.silence(shot)
                check_values(effect, "silence", quiet, beams, 0.0)
                silent *= quiet
            seen[returns.beam] *= kept
            elsewhere[returns.beam] *= kept
    silent = _silent(seen, returns, elsewhere) if silent is None else silent
    seen = _answering(seen, returns)
    mean_range, mean_intensity = np.full(beams, np.nan), np.zeros(beams)
    mean_range[returns.beam] = returns.range_m
    mean_intensity[returns.beam] = returns.intensity.clip(0, 1)
    return Expectation(
        range_m=mean_range,
        range_sigma_m=np.sqrt(range_variance),
        intensity=mean_intensity,
        intensity_sigma=np.sqrt(intensity_variance),
        seen=seen,
        silent=silent,
        elsewhere=elsewhere,
    )


def spurious_density(effect: Effect, beam: np.ndarray, range_m: np.ndarray, shot: Shot) -> np.ndarray:
    """Return the probability per metre (k,) that an effect puts a return of `beam` (k,) at `range_m` (k,).

    Raises:
        SensorError: a user's effect raises an error, or gives another shape, NaN or values below 0.
    """
    with blamed(effect, ""):
        density = effect.density(beam, range_m, shot)
    check_values(effect, "density", density, len(beam), 0.0)
    return density


def _answer(effect: EchoEffect, returns: Returns, shot: Shot) -> tuple[Returns, np.ndarray]:
    """Returns after an echo effect, and the probability (m,) of each."""
    with blamed(effect, ""):
        changed, chance = effect.expected(returns, shot)
    if effect.source:
        check_returns(effect, returns, changed, shot, "")
    check_values(effect, "kept", chance, len(changed), 0.0)
    return changed, chance


def _silent(seen: np.ndarray, returns: Returns, elsewhere: np.ndarray) -> np.ndarray:
    """Chances (n,) that neither the surface nor another one is reported."""
    return np.maximum(1 - _answering(seen, returns) - elsewhere, 0)


def _answering(seen: np.ndarray, returns: Returns) -> np.ndarray:
    """Chances (n,) of a return; 0 of beams that have none."""
    found = np.zeros(len(seen))
    found[returns.beam] = seen[returns.beam]
    return found


def _mean_and_spread(
    effect: PointEffect, returns: Returns, shot: Shot
) -> tuple[Returns, tuple[np.ndarray | float, np.ndarray | float]]:
    """Returns after a point effect, and the variances it brings; some draw random numbers."""
    rng = np.random.default_rng(0)
    before = rng.bit_generator.state
    with blamed(effect, ""):
        changed = effect.apply(returns, shot, rng)
    if effect.source:
        check_returns(effect, returns, changed, shot, "")
    if rng.bit_generator.state == before:  # it draws no random numbers
        return changed, (0.0, 0.0)
    draws = [effect.apply(returns, shot, np.random.default_rng(seed)) for seed in range(1, _DRAWS)]
    ranges = np.stack([changed.range_m, *(draw.range_m for draw in draws)])
    intensities = np.stack([changed.intensity, *(draw.intensity for draw in draws)])
    mean = replace(changed, range_m=ranges.mean(0), intensity=intensities.mean(0))
    return mean, (ranges.var(0, ddof=1), intensities.var(0, ddof=1))

"""Expectation of every beam under a sensor model: means, standard deviations and probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np

from sensors.effects.base import Effect
from sensors.effects.blame import blamed, check_values
from sensors.effects.expected_state import ExpectedState
from sensors.shot import Shot

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


class ExpectationMemo:
    """Expectations of one shot after each effect of its latest models, so that later models resume where they differ.

    A fit compares models that differ in one effect at a time. Arrays that an effect does not change are shared.
    """

    def __init__(self) -> None:
        self._chains: dict[tuple[int, float], list[_Chain]] = {}

    def resumed(self, effects: Sequence[Effect], texture: int, reflectance_factor: float) -> _Chain | None:
        """The chain with the most effects in common from the first on, shortened to these; None without any."""
        chains = self._chains.get((texture, reflectance_factor), [])
        best = max(chains, key=lambda chain: chain.common(effects), default=None)
        if best is None:
            return None
        chains.remove(best)
        chains.append(best)
        return best.first(best.common(effects))

    def keep(self, chain: _Chain, texture: int, reflectance_factor: float) -> None:
        """Keep a chain for later models, and with it only the latest of the others."""
        chains = self._chains.setdefault((texture, reflectance_factor), [])
        chains[:] = [*chains[-1:], chain]


@dataclass(frozen=True, eq=False)
class _Chain:
    """Effects (k) and the states before the first and after each of them (k + 1)."""

    effects: tuple[Effect, ...]
    states: tuple[ExpectedState, ...]

    def common(self, effects: Sequence[Effect]) -> int:
        """Number of effects that both have in common, from the first on."""
        pairs = zip(self.effects, effects, strict=False)
        return sum(1 for _ in takewhile(lambda pair: pair[0] is pair[1] or pair[0] == pair[1], pairs))

    def first(self, count: int) -> _Chain:
        """The first effects and their states."""
        return _Chain(self.effects[:count], self.states[: count + 1])


def expect(
    effects: Sequence[Effect],
    shot: Shot,
    twin_sigmas: tuple[np.ndarray, np.ndarray] | None = None,
    reflectance_factor: float = 1.0,
    memo: ExpectationMemo | None = None,
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
        memo: of the same shot and the same `twin_sigmas`.
    """
    twin_variance = np.zeros((2, len(shot.rays))) if twin_sigmas is None else np.square(np.stack(twin_sigmas))
    if shot.is_texture_known or not any(effect.has_texture for effect in effects):
        return _expect(effects, shot, twin_variance, reflectance_factor, memo)
    shots = [shot.with_texture(number) for number in range(1, _TEXTURES + 1)]
    mixed = _mixture([_expect(effects, one, twin_variance, reflectance_factor, memo) for one in shots])
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
    twin_variance: np.ndarray,
    reflectance_factor: float,
    memo: ExpectationMemo | None,
) -> Expectation:
    """Expectation of a traced shot for one texture; `twin_variance` as of `ExpectedState.after`, the rest as above."""
    chain = None if memo is None else memo.resumed(effects, shot.texture, reflectance_factor)
    states = [ExpectedState.of(shot, reflectance_factor)] if chain is None else list(chain.states)
    for effect in effects[len(states) - 1 :]:
        states.append(states[-1].after(effect, shot, twin_variance))
        if memo is None:
            del states[:-1]
    if memo is not None and (chain is None or len(chain.effects) < len(effects)):
        memo.keep(_Chain(tuple(effects), tuple(states)), shot.texture, reflectance_factor)
    state, beams = states[-1], len(shot.rays)
    shot.noiseless, returns = state.noiseless, state.returns
    mean_range, mean_intensity = np.full(beams, np.nan), np.zeros(beams)
    mean_range[returns.beam] = returns.range_m
    mean_intensity[returns.beam] = returns.intensity.clip(0, 1)
    range_sigma_m, intensity_sigma = np.sqrt(state.variance)
    return Expectation(
        range_m=mean_range,
        range_sigma_m=range_sigma_m,
        intensity=mean_intensity,
        intensity_sigma=intensity_sigma,
        seen=state.answering(),
        silent=state.silence(),
        elsewhere=state.elsewhere,
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

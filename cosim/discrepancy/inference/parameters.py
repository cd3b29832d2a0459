"""Fitted parameters of effects as one vector: selection, steps, priors of per-laser lists."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.candidates import Unknown, unknowns, with_values
from cosim.discrepancy.inference.dependence import SPREADS
from cosim.discrepancy.inference.score import Column
from sensors.effects.base import Effect, RoundingEffect


@dataclass(frozen=True)
class Free:
    """A fitted parameter.

    Attributes:
        effect: index of the effect in the model.
        unknown: the parameter of this effect.
    """

    effect: int
    unknown: Unknown


def all_free(effects: Sequence[Effect], indices: Sequence[int], rings: int) -> tuple[Free, ...]:
    """All parameters of the effects at the given indices that can be fitted; per-laser lists only of length `rings`."""
    parameters = []
    for index in indices:
        if isinstance(effects[index], RoundingEffect):
            continue  # a rounding step cannot be estimated from residuals; see `quantization.py`
        for unknown in unknowns(type(effects[index])):
            length = np.size(getattr(effects[index], unknown.name))
            if unknown.rings == 1 or length == rings:
                parameters.append(Free(index, unknown))
    return tuple(parameters)


def list_numbers(effects: tuple[Effect, ...], free: Sequence[Free]) -> np.ndarray:
    """(p,) int number of the per-laser list that each parameter belongs to, from 1; 0 for all other parameters.

    Only for maps made from the scans. There, on level ground, elevation errors in proportion to the beams' slopes
    are confounded with the sensor's height. Per-laser parameters therefore get a normal prior around the neutral
    value, whose variance is estimated.
    """
    lists = [bool(p.unknown.rings > 1 and type(effects[p.effect]).neutral) for p in free]
    return np.repeat(np.cumsum(lists, dtype=int) * lists, [parameter.unknown.rings for parameter in free])


def deviations(effects: tuple[Effect, ...], free: Sequence[Free]) -> np.ndarray:
    """(p,) deviations of per-laser parameters from the neutral value; 0 for other parameters."""
    deviations = [np.zeros(0)]
    for parameter in free:
        effect, name, deviation = effects[parameter.effect], parameter.unknown.name, np.zeros(parameter.unknown.rings)
        if parameter.unknown.rings > 1 and effect.neutral is not None:
            deviation = np.asarray(getattr(effect, name), float) - np.ravel(effect.neutral[name])[0]
        deviations.append(deviation)
    return np.concatenate(deviations)


def updated_prior_precisions(lists: np.ndarray, deviations: np.ndarray, information: np.ndarray) -> np.ndarray:
    """Precisions (p,) of the priors of per-laser lists after one EM step (Dempster, Laird and Rubin, 1977)."""
    spread = deviations**2 + np.diag(np.linalg.pinv(information, hermitian=True))
    precisions = np.zeros(len(lists))
    for number in range(1, int(lists.max()) + 1):
        precisions[lists == number] = 1 / max(float(spread[lists == number].mean()), 1e-12)
    return precisions


def has_moved(reference: tuple[Effect, ...], effects: tuple[Effect, ...], free: Sequence[Free]) -> bool:
    """Whether a parameter has moved by more than its step size, so that cached derivatives are no longer valid."""
    moves = [
        np.subtract(*(getattr(model[parameter.effect], parameter.unknown.name) for model in (reference, effects)))
        for parameter in free
    ]
    return any(np.any(np.abs(move) > parameter.unknown.step) for move, parameter in zip(moves, free, strict=True))


def apply_step(effects: tuple[Effect, ...], free: Sequence[Free], step: np.ndarray) -> tuple[Effect, ...]:
    """Add a step (p,) to the free parameters; angles on the full circle stay within ±180°."""
    changed = list(effects)
    for parameter, rows in _rows(free):
        value = np.asarray(getattr(changed[parameter.effect], parameter.unknown.name), float)
        moved = value + (step[rows] if value.ndim else step[rows][0])
        if parameter.unknown.is_direction:
            moved = (moved + 180) % 360 - 180
        changed[parameter.effect] = with_values(changed[parameter.effect], {parameter.unknown.name: moved})
    return tuple(changed)


def step_limits(
    effects: Sequence[Effect], free: Sequence[Free], is_spread: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest step (size,) of the free parameters within their bounds; none for what follows them.

    Parameters that change nothing but spreads (`is_spread`, see `acts_on_spreads`) have no limits: the derivative of a
    variance with respect to σ is 0 at σ = 0, so that a fit could not leave this bound again.
    """
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    for parameter, rows in _rows(free):
        unknown = parameter.unknown
        if not unknown.is_direction and not is_spread[rows].any():
            value = np.asarray(getattr(effects[parameter.effect], unknown.name), float)
            low[rows], high[rows] = unknown.low - value, unknown.high - value
    return low, high


def acts_on_spreads(columns: Sequence[Column]) -> np.ndarray:
    """(p,) bool parameters that change nothing but spreads, from the derivatives of the prediction."""
    only = [bool(column.delta) and set(column.delta) <= set(SPREADS) for column in columns]
    return np.repeat(np.array(only, bool), [column.rings for column in columns])


def is_relative(effects: Sequence[Effect], parameter: Free, of_own_map: bool) -> bool:
    """Whether only differences between lasers can be determined: of gains, on maps with unknown reflectances."""
    return of_own_map and parameter.unknown.rings > 1 and effects[parameter.effect].channel == "intensity"


def without_common_gain(
    effects: Sequence[Effect], free: Sequence[Free], step: np.ndarray, of_own_map: bool
) -> np.ndarray:
    """A step (p,) without the common factor of per-laser gains, which is confounded with a map's reflectances."""
    step = step.copy()
    for parameter, rows in _rows(free):
        if is_relative(effects, parameter, of_own_map):
            gains = np.asarray(getattr(effects[parameter.effect], parameter.unknown.name), float)
            step[rows] -= gains * step[rows].sum() / gains.sum()
    return step


def _rows(free: Sequence[Free]) -> Iterator[tuple[Free, slice]]:
    """Each parameter with its rows of a vector of all of them."""
    start = 0
    for parameter in free:
        yield parameter, slice(start, start + parameter.unknown.rings)
        start += parameter.unknown.rings

"""Fitted parameters of effects as one vector: selection, steps, priors of per-laser lists, cached derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.candidates import Unknown, unknowns, with_values
from cosim.discrepancy.inference.score import Column
from sensors.effects.base import Effect, RoundingEffect

_CACHED_MODELS = 4  # number of models whose derivatives are cached


@dataclass(frozen=True)
class Free:
    """A fitted parameter.

    Attributes:
        effect: index of the effect in the model.
        unknown: the parameter of this effect.
    """

    effect: int
    unknown: Unknown


@dataclass(frozen=True, eq=False)
class _CachedDerivatives:
    """Derivatives of one model.

    Attributes:
        effects: effects at whose parameters the derivatives were computed.
        columns: derivative of the prediction for each free parameter.
        is_exact: whether all were computed with all effects.
    """

    effects: tuple[Effect, ...]
    columns: dict[Free, Column]
    is_exact: bool


class DerivativeCache:
    """Cache of the derivatives with respect to effect parameters, and of the parameter values they belong to."""

    def __init__(self) -> None:
        self._entries: list[_CachedDerivatives] = []

    def columns(self, effects: tuple[Effect, ...], free: Sequence[Free], *, simplified: bool) -> dict[Free, Column]:
        """Return the cached derivatives that are valid near these effects; entries added to the result are cached.

        Args:
            effects: effects of the model.
            free: free parameters of the model.
            simplified: whether derivatives of a model without the last effects are accepted.
        """
        for entry in self._entries:
            if (entry.is_exact or simplified) and _is_near(entry.effects, effects, free):
                return entry.columns
        entry = _CachedDerivatives(effects, {}, is_exact=True)
        for smaller in self._entries if simplified else ():
            size = len(smaller.effects)
            if _is_near(smaller.effects, effects[:size], [parameter for parameter in free if parameter.effect < size]):
                entry = _CachedDerivatives(effects, dict(smaller.columns), is_exact=False)
                break
        self._entries = [entry, *self._entries[: _CACHED_MODELS - 1]]
        return entry.columns


def _is_near(reference: tuple[Effect, ...], effects: tuple[Effect, ...], free: Sequence[Free]) -> bool:
    """Whether two models differ only in values of free parameters, and by less than the step of each."""
    return _differ_only_in(reference, effects, free) and not has_moved(reference, effects, free)


def _differ_only_in(reference: tuple[Effect, ...], effects: tuple[Effect, ...], free: Sequence[Free]) -> bool:
    """Whether two models differ only in the values of free parameters."""
    if len(reference) != len(effects):
        return False
    names: dict[int, set[str]] = {}
    for parameter in free:
        names.setdefault(parameter.effect, set()).add(parameter.unknown.name)
    for index, (old, new) in enumerate(zip(reference, effects, strict=True)):
        if type(old) is not type(new):
            return False
        if old != new and old.model_dump(exclude=names.get(index)) != new.model_dump(exclude=names.get(index)):
            return False
    return True


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
    """Add a step (p,) to the free parameters."""
    changed, start = list(effects), 0
    for parameter in free:
        value = np.asarray(getattr(changed[parameter.effect], parameter.unknown.name), float)
        part = step[start : start + parameter.unknown.rings]
        start += parameter.unknown.rings
        moved = value + (part if value.ndim else part[0])
        changed[parameter.effect] = with_values(changed[parameter.effect], {parameter.unknown.name: moved})
    return tuple(changed)

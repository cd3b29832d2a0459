"""Derivatives of predictions with respect to parameters of effects: finite differences, which are cached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.candidates import Unknown, with_values
from cosim.discrepancy.inference.parameters import Free, has_moved
from cosim.discrepancy.inference.score import Column, Quantity, change
from cosim.discrepancy.sampling.sample import Prediction, Sample
from sensors.effects.acting import bending
from sensors.effects.base import BeamEffect, Effect

_CACHED_MODELS = 4  # number of models whose derivatives are cached


class Derivatives:
    """Derivatives of the predictions of a sample."""

    def __init__(self, sample: Sample) -> None:
        self._sample = sample
        self._cache = _Cache()

    def of(
        self, effects: tuple[Effect, ...], free: Sequence[Free], at: Prediction, *, simplified: bool = False
    ) -> tuple[Column, ...]:
        """Derivatives of the effects' prediction with respect to each free parameter.

        Cached derivatives are reused if no parameter has moved by more than its step size since they were computed;
        with `simplified` also those of a model without the last effects.
        """
        cached = self._cache.columns(effects, free, simplified=simplified)
        for parameter in free:
            if parameter not in cached:
                cached[parameter] = self._slope(effects, parameter, at)
        return tuple(cached[parameter] for parameter in free)

    def _slope(self, effects: tuple[Effect, ...], parameter: Free, at: Prediction) -> Column:
        """Derivative with respect to one free parameter by a finite difference."""
        effect, unknown = effects[parameter.effect], parameter.unknown
        value = np.asarray(getattr(effect, unknown.name), float)
        step = unknown.step if np.all(value + unknown.step <= unknown.high) else -unknown.step
        delta = difference_quotients(self._sample, effects, parameter.effect, unknown, step, at)
        return Column(delta, self._sample.ring if unknown.rings > 1 else None, unknown.rings)


def difference_quotients(
    sample: Sample, effects: tuple[Effect, ...], index: int, unknown: Unknown, step: float, at: Prediction
) -> dict[Quantity, np.ndarray]:
    """Derivatives (n,) of the effects' prediction with respect to one parameter, by quantity.

    Central differences if ranges change, otherwise one-sided ones. Ranges are nonlinear in beam angles where the
    incidence is grazing: their derivative is the harmonic mean of the two one-sided differences, which is exact for a
    plane (R = c/ε at a small angle ε to it), and 0 where they differ in sign (van Leer, J. Comput. Phys. 14, 1974).
    Where beams are deflected, the range is that of the plane which the centre of the beam hits, as for pose errors:
    what the rest of a footprint hits near an edge changes in jumps.

    Args:
        sample: sample of measured beams.
        effects: effects of the model.
        index: of the effect in `effects`.
        unknown: its parameter.
        step: change of the parameter.
        at: prediction with `effects`.
    """
    effect = effects[index]
    value = np.asarray(getattr(effect, unknown.name), float)
    is_two_sided = bool(np.all(np.clip(value - step, unknown.low, unknown.high) == value - step))
    centres = sample.predict(bending(effects)) if isinstance(effect, BeamEffect) else None

    def predict(value: np.ndarray) -> Prediction:
        moved = with_values(effect, {unknown.name: value})
        model = (*effects[:index], moved, *effects[index + 1 :])
        predicted = sample.predict(model)
        if centres is None:
            return predicted
        by_centre = at.range_m + sample.predict(bending(model)).range_m - centres.range_m
        return replace(predicted, range_m=by_centre)

    def difference(before: Prediction, after: Prediction) -> dict[Quantity, np.ndarray]:
        return {name: values / step for name, values in change(sample, before, after).items()}

    right = difference(at, predict(value + step))
    if "range" not in right or not is_two_sided:
        return right
    left = difference(predict(value - step), at)
    zeros = np.zeros(len(sample))
    slopes: dict[Quantity, np.ndarray] = {}
    for name in dict.fromkeys((*left, *right)):
        one, other = left.get(name, zeros), right.get(name, zeros)
        slopes[name] = _harmonic_mean(one, other) if name == "range" else (one + other) / 2
    return slopes


def _harmonic_mean(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Harmonic mean; 0 where the signs differ."""
    same = one * other > 0
    return np.where(same, 2 * one * other / np.where(same, one + other, 1.0), 0.0)


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


class _Cache:
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

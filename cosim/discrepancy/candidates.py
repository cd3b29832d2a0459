"""Candidate effects: their fittable parameters, amplitudes, and weak forms for linearisation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sensors.effects.base import Effect, RoundingEffect
from sensors.effects.lasers import for_rings
from sensors.effects.registry import effect_classes

_SMALL = 0.02


@dataclass(frozen=True)
class Unknown:
    """A parameter of an effect that can be fitted.

    Attributes:
        name: name of the parameter.
        step: step of finite differences, in the parameter's unit.
        low, high: bounds; infinite if there are none.
        rings: number of values: one per ring, or 1.
    """

    name: str
    step: float
    low: float
    high: float
    rings: int

    @property
    def is_direction(self) -> bool:
        """Whether it is an angle on the full circle [°], for which effects allow one turn to each side."""
        return (self.low, self.high) == (-360.0, 360.0)


def unknowns(kind: type[Effect]) -> tuple[Unknown, ...]:
    """Fittable parameters of an effect, in order; those with choices, and optional ones without a scale, are excluded.

    The scale of a parameter follows from the effect's example.
    """
    parameters = []
    for parameter in kind.parameters():
        if parameter.choices or parameter.name not in kind.example:
            continue
        rings = len(kind.example[parameter.name]) if parameter.per_ring else 1
        low = -np.inf if parameter.low is None else parameter.low
        high = np.inf if parameter.high is None else parameter.high
        parameters.append(Unknown(parameter.name, _scale(kind, parameter.name) * _SMALL, low, high, rings))
    return tuple(parameters)


def switches(kind: type[Effect]) -> tuple[str, ...]:
    """Names of the parameters that switch an effect on: neutral at 0, or different in its example."""
    neutral = kind.neutral or {}
    return tuple(
        unknown.name
        for unknown in unknowns(kind)
        if np.all(np.equal(neutral[unknown.name], 0)) or neutral[unknown.name] != kind.example[unknown.name]
    )


def is_unchanged(kind: type[Effect], ci95: Mapping[str, Any], reference: Mapping[str, Any] | None) -> bool:
    """Whether the intervals of all parameters that switch an effect on include the values of `reference`.

    Args:
        kind: of the effect.
        ci95: intervals by parameter: (2,), or (n, 2) of a list.
        reference: values by parameter, or None for an effect that has no neutral ones.
    """
    sizes = [parameter for parameter in switches(kind) if parameter in ci95]
    if not sizes or reference is None:
        return False
    pairs = {parameter: np.asarray(ci95[parameter], float).reshape(-1, 2) for parameter in sizes}
    values = {parameter: np.ravel(np.asarray(reference[parameter], float)) for parameter in sizes}
    return all(
        bool(np.all((pair[:, 0] <= values[parameter]) & (values[parameter] <= pair[:, 1])))
        for parameter, pair in pairs.items()
    )


def amplitudes(kind: type[Effect]) -> tuple[str, ...]:
    """The switches whose derivative is tested; values of others are tried one by one (`shapes`)."""
    shaped = {name for shape in kind.shapes for name in shape}
    return tuple(name for name in switches(kind) if name not in shaped)


def weak_forms(kind: type[Effect]) -> Iterator[tuple[Effect, str, float]]:
    """Yield the effect with a small amplitude, the name of the amplitude and its change, for each amplitude and shape.

    For effects without amplitude each shape is yielded with an empty name and a change of 1.
    """
    neutral = dict(kind.neutral or kind.example)
    names = amplitudes(kind)
    for shape in kind.shapes or ({},):
        off = {**neutral, **shape}
        for name in names:
            weak = _weak_value(neutral[name], kind.example[name], _SMALL, _scale(kind, name))
            step = float(np.mean(np.subtract(weak, neutral[name])))
            yield kind.model_validate({**off, name: weak}), name, step
        if not names:
            yield kind.model_validate(off), "", 1.0


def with_values(effect: Effect, values: Mapping[str, Any]) -> Effect:
    """Return the effect with some parameters changed, clipped to their bounds."""
    kind = type(effect)
    clipped: dict[str, Any] = {}
    for name, value in values.items():
        bounds = next((u for u in unknowns(kind) if u.name == name), None)
        if bounds is not None:
            value = np.clip(value, bounds.low, bounds.high)
            value = tuple(value.tolist()) if np.ndim(value) else float(value)
        clipped[name] = value
    return kind.model_validate({**effect.model_dump(), **clipped})


def candidate_effects(extra: Sequence[type[Effect]] = (), rings: int = 64) -> tuple[type[Effect], ...]:
    """Effects that a diagnosis tests: of the catalogue, installed plug-ins, and user-supplied ones.

    Args:
        extra: user-supplied effects.
        rings: number of lasers of the sensor, the length of per-laser parameters.
    """
    types = {kind.name: kind for kind in effect_classes().values() if kind.is_candidate}
    types.update({kind.name: kind for kind in extra})
    return tuple(for_rings(kind, rings) for kind in types.values() if _is_observable(kind))


def confusable(one: type[Effect], other: type[Effect]) -> bool:
    """Whether one of the effects declares the other as confusable."""
    return one.name in other.confusable_with or other.name in one.confusable_with


def _is_observable(kind: type[Effect]) -> bool:
    has_neutral = kind.neutral is not None or issubclass(kind, RoundingEffect)
    return has_neutral and kind.stage not in ("label", "traffic")


def _scale(kind: type[Effect], name: str) -> float:
    """Natural scale of a parameter: the difference of example and neutral value, or the example if that is smaller.

    Effects that act below a limit are neutral at a limit far above the example.
    """
    example = float(np.mean(np.abs(kind.example[name])))
    apart = float(np.mean(np.abs(np.subtract(kind.example[name], (kind.neutral or kind.example)[name]))))
    return min((value for value in (apart, example) if value), default=1.0)


def _weak_value(neutral: Any, example: Any, share: float, scale: float) -> Any:
    if isinstance(neutral, tuple | list):
        return tuple(float(value) + share * scale for value in neutral)
    return neutral + share * (example - neutral if example != neutral else scale)

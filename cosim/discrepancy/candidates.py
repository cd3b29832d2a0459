"""The effects that may be missing, with as many numbers as the sensor has lasers, and where to look for each."""

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
    """One number of an effect that can be fitted, or one a ring.

    Attributes:
        name: of the parameter.
        step: for finite differences.
        low, high: bounds.
        rings: how many numbers, 1 for plain ones.
    """

    name: str
    step: float
    low: float
    high: float
    rings: int


def unknowns(kind: type[Effect]) -> tuple[Unknown, ...]:
    """What can be fitted of an effect: its numbers, in order."""
    found = []
    for parameter in kind.parameters():
        if parameter.choices:
            continue
        rings = len(kind.example[parameter.name]) if parameter.per_ring else 1
        low = -np.inf if parameter.low is None else parameter.low
        high = np.inf if parameter.high is None else parameter.high
        found.append(Unknown(parameter.name, _scale(kind, parameter.name) * _SMALL, low, high, rings))
    return tuple(found)


def amplitudes(kind: type[Effect]) -> tuple[str, ...]:
    """Parameters that switch an effect on: numbers that do nothing at 0, or that its example changes."""
    neutral, shaped = kind.neutral or {}, {name for shape in kind.shapes for name in shape}
    names = []
    for unknown in unknowns(kind):
        still = np.all(np.equal(neutral[unknown.name], 0)) or neutral[unknown.name] != kind.example[unknown.name]
        if still and unknown.name not in shaped:
            names.append(unknown.name)
    return tuple(names)


def weak_forms(kind: type[Effect]) -> Iterator[tuple[Effect, str, float]]:
    """An effect weakly on, the amplitude that does it and by how much, for each amplitude and shape.

    Shapes that leave no amplitude are whole settings of their own; their amplitude is empty.
    """
    neutral = dict(kind.neutral or kind.example)
    names = amplitudes(kind)
    for shape in kind.shapes or ({},):
        off = {**neutral, **shape}
        for name in names:
            weak = _between(neutral[name], kind.example[name], _SMALL, _scale(kind, name))
            step = float(np.mean(np.subtract(weak, neutral[name])))
            yield kind.model_validate({**off, name: weak}), name, step
        if not names:
            yield kind.model_validate(off), "", 1.0


def with_values(effect: Effect, values: Mapping[str, Any]) -> Effect:
    """An effect with some parameters changed, within their bounds."""
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
    """Effects that a diagnosis asks for: of the catalogue, installed ones, and the user's own.

    Args:
        extra: the user's own.
        rings: lasers of the sensor.
    """
    kinds = {kind.name: kind for kind in effect_classes().values() if kind.is_candidate}
    kinds.update({kind.name: kind for kind in extra})
    return tuple(for_rings(kind, rings) for kind in kinds.values() if _is_asked_for(kind))


def confusable(one: type[Effect], other: type[Effect]) -> bool:
    """Whether either says that the other's traces look like its own."""
    return one.name in other.confusable_with or other.name in one.confusable_with


def _is_asked_for(kind: type[Effect]) -> bool:
    shows = kind.neutral is not None or issubclass(kind, RoundingEffect)
    return shows and kind.stage not in ("label", "traffic")


def _scale(kind: type[Effect], name: str) -> float:
    """A natural size of a parameter."""
    example = np.mean(np.abs(kind.example[name]))
    apart = np.mean(np.abs(np.subtract(kind.example[name], (kind.neutral or kind.example)[name])))
    return float(apart or example or 1.0)


def _between(neutral: Any, example: Any, share: float, scale: float) -> Any:
    if isinstance(neutral, tuple | list):
        return tuple(float(value) + share * scale for value in neutral)
    return neutral + share * (example - neutral if example != neutral else scale)

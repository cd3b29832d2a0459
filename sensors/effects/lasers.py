"""Effects with one number a laser, for sensors of any number of lasers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import create_model

from sensors.effects.base import Effect
from sensors.effects.registry import effect_classes


def for_rings(kind: type[Effect], rings: int) -> type[Effect]:
    """An effect with lists of one number per laser, whose initial length is the number of lasers."""
    lists = [one.name for one in kind.parameters() if one.per_ring]
    if not kind.example or all(len(kind.example[name]) == rings for name in lists):
        return kind
    sized = create_model(kind.__name__, __base__=kind, __module__=kind.__module__, __doc__=kind.__doc__)
    sized.example = _sized(kind.example, lists, rings)
    sized.neutral = _sized(kind.neutral, lists, rings) if kind.neutral is not None else None
    return sized


def with_rings(effects: Sequence[Effect], rings: int) -> tuple[Effect, ...]:
    """Effects as fits need them: each of the class that has as many numbers as there are lasers."""
    types = [for_rings(type(effect), rings) for effect in effects]
    return tuple(
        effect if kind is type(effect) else kind.model_validate(effect.model_dump())
        for effect, kind in zip(effects, types, strict=True)
    )


def as_known(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Return the effects as instances of the classes of the catalogue and the user."""
    known = effect_classes()
    types = [known.get(effect.name, type(effect)) for effect in effects]
    return tuple(
        kind.model_validate(effect.model_dump())
        if type(effect) is not kind and issubclass(type(effect), kind)
        else effect
        for effect, kind in zip(effects, types, strict=True)
    )


def _sized(values: dict[str, Any], lists: Sequence[str], rings: int) -> dict[str, Any]:
    return {name: np.resize(value, rings).tolist() if name in lists else value for name, value in values.items()}

"""A shape as the plug-in that will be written, fitted like any effect."""

from __future__ import annotations

import tempfile
from pathlib import Path

from cosim.discrepancy.unknown.shape import Shape
from cosim.discrepancy.unknown.write import class_name, effect_source
from sensors.effects.base import Effect
from sensors.effects.registry import find_effect


def shape_effect(shape: Shape) -> Effect:
    """The effect of a shape, at the size found."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "unknown_effect.py"
        file.write_text(effect_source(shape), encoding="utf-8")
        kind = find_effect(f"{file.name}:{class_name(shape)}", Path(folder))
    return kind.model_validate(kind.example)

"""Objects of one class that are too small or too large in the twin."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hidden.truth import Finding
from tests.hidden.unseen.kind import Kind, Parameters, World, amplitude, pick

_SIZES = ("length_m", "width_m", "height_m")
_FEWEST_OBJECTS, _FEWEST_BEAMS = 4, 150  # beams in a scan
_BOTH_SIDES = 2  # a surface moves by half of what the size changes


def _draw(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    name = pick(rng, world.kinds(_FEWEST_OBJECTS, _FEWEST_BEAMS))
    size = _BOTH_SIDES * amplitude(rng, level, "range_m", signed=True)
    axes = pick(rng, ([1, 1, 1], [1, 0, 0], [0, 1, 0], [1, 1, 0]))
    return {"kind": name, "change_m": [round(size * axis, 5) for axis in axes]}


def _resize(frames: list[dict], p: Parameters) -> None:
    """Change the written sizes of all objects of a kind."""
    for frame in frames:
        for thing in frame["instances"]:
            if thing["kind"] == p["kind"]:
                true = np.array([thing[name] for name in _SIZES])
                factor = np.maximum(true + p["change_m"], 0.1) / true
                thing["scale"] = np.round(np.array(thing["scale"]) * factor, 9).tolist()
                thing.update(zip(_SIZES, np.round(true * factor, 6).tolist(), strict=True))


def _truths(p: Parameters, world: World) -> tuple[Finding, ...]:
    names = ("object_size", "kind", "class", "model", "instance")
    return (Finding(("range",), (names,), effects=("box_shrink",)),)


OBJECTS: dict[str, Kind] = {"object_size": Kind(_draw, _truths, lambda p: "twin", _resize)}

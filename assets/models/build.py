"""Meshes of catalogue models, each of which fills its box exactly."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from assets.cache import cached
from assets.mesh import Mesh
from assets.models.bicycle import build_bicycle
from assets.models.bus import build_bus
from assets.models.car import build_car
from assets.models.catalogue import Body, ModelSpec, model_spec
from assets.models.motorcycle import build_motorcycle
from assets.models.pedestrian import build_pedestrian, build_person_sitting
from assets.models.tram import build_tram
from assets.models.truck import build_truck
from assets.shapes import clean

_BUILDERS: dict[Body, Callable[[ModelSpec], Mesh]] = {
    "hatchback": build_car,
    "saloon": build_car,
    "estate": build_car,
    "suv": build_car,
    "van": build_car,
    "truck": build_truck,
    "bus": build_bus,
    "tram": build_tram,
    "motorcycle": build_motorcycle,
    "bicycle": build_bicycle,
    "pedestrian": build_pedestrian,
    "person_sitting": build_person_sitting,
}


@cached
def build_model(name: str) -> Mesh:
    """Mesh of a catalogue model: x forward, y left, z up, origin at the ground-level centre of its box.

    The bounds are exactly ±length/2, ±width/2 and 0…height of the catalogue entry, in float32. The result
    depends only on the name; callers cache it, as building takes some milliseconds.

    Raises:
        KeyError: no model has this name.
    """
    spec = model_spec(name)
    return fit_to_box(_BUILDERS[spec.body](spec), spec)


def fit_to_box(mesh: Mesh, spec: ModelSpec) -> Mesh:
    """The mesh stretched along each axis so that its bounds equal the box of `spec`."""
    vertices = mesh.vertices.astype(np.float64)
    low, high = vertices.min(0), vertices.max(0)
    size = np.array(spec.size_m)
    fitted = (vertices - low) / (high - low) * size - size * (0.5, 0.5, 0.0)
    return clean(Mesh(fitted, mesh.faces, mesh.materials))

"""A plain stand-in: a box on a chassis with a glazed cabin."""

from __future__ import annotations

from assets.mesh import Mesh
from assets.models.catalogue import ModelSpec
from assets.shapes import box, cylinder


def build_plain(spec: ModelSpec) -> Mesh:
    """Box model with wheels and a cabin of glass."""
    length, width, height = spec.size_m
    if spec.kind in ("pedestrian", "cyclist", "motorcycle"):
        return box(spec.size_m, (0, 0, height / 2), "clothing")
    radius = 0.2 * height
    parts = [
        box((length, width, 0.4 * height), (0, 0, 0.35 * height), "car_paint"),
        box((0.5 * length, 0.8 * width, 0.45 * height), (0, 0, 0.775 * height), "car_paint"),
    ]
    for x in (spec.front_axle_x_m, spec.rear_axle_x_m):
        for y in (-spec.track_m / 2, spec.track_m / 2):
            parts.append(cylinder(radius, 0.2, "tyre", 20, axis="y").moved((x, y - 0.1, radius)))
    return Mesh.merge(parts)

"""Axle positions of a mesh, from its tyres or else from typical proportions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.materials import material_index
from assets.mesh import Mesh
from assets.models.catalogue import CATALOGUE, Kind

_GAP_M = 0.08  # between the tyres of one axle and the next, seen from the side
_GROUNDED_M = 0.3  # a tyre or its rim reaches below this; a spare wheel does not
_GROUP_M = 2.0  # axles nearer than this to the rearmost belong to its group
_NARROWEST_TRACK_M = 0.5


@dataclass(frozen=True)
class Axles:
    """Positions along x of the front axle and of the rearmost axle group, and the track; 0 track: one wheel wide."""

    front_x_m: float
    rear_x_m: float
    track_m: float


def find_axles(mesh: Mesh, kind: Kind) -> Axles:
    """The axles of a vehicle mesh in our frame."""
    for material in ("tyre", "wheel_rim"):
        found = _from_wheels(mesh, material)
        if found is not None:
            return found
    return _from_proportions(mesh, kind)


def _from_wheels(mesh: Mesh, material: str) -> Axles | None:
    faces = mesh.faces[mesh.materials == material_index(material)]
    if not len(faces):
        return None
    corners = mesh.vertices[faces].astype(np.float64)
    low, high = corners[..., 0].min(1), corners[..., 0].max(1)
    order = np.argsort(low)
    reach = np.maximum.accumulate(high[order])
    run = np.concatenate([[0], np.cumsum(low[order][1:] > reach[:-1] + _GAP_M)])
    axles = []
    for number in range(run[-1] + 1):
        wheels = corners[order[run == number]].reshape(-1, 3)
        if wheels[:, 2].min() < _GROUNDED_M + mesh.bounds[0, 2]:
            axles.append(wheels)
    if len(axles) < 2:
        return None
    middles = np.array([(wheels[:, 0].min() + wheels[:, 0].max()) / 2 for wheels in axles])
    last = middles[(middles < middles.min() + _GROUP_M) & (middles < middles.max())]
    return Axles(float(middles.max()), float(last.mean()), _track(axles[int(middles.argmax())][:, 1]))


def _track(y: np.ndarray) -> float:
    if y.min() > -_NARROWEST_TRACK_M / 2 or y.max() < _NARROWEST_TRACK_M / 2:
        return 0.0
    left, right = y[y > 0], y[y < 0]
    return float((left.min() + left.max()) / 2 - (right.min() + right.max()) / 2)


def _from_proportions(mesh: Mesh, kind: Kind) -> Axles:
    """Those of the most similar catalogue model of the kind, stretched to the mesh's box."""
    size = np.ptp(mesh.bounds, axis=0).astype(np.float64)
    similar = min(
        (spec for spec in CATALOGUE.values() if spec.kind == kind),
        key=lambda spec: float(np.abs(np.log(size / np.array(spec.size_m))).max()),
    )
    along, across = size[0] / similar.length_m, size[1] / similar.width_m
    return Axles(similar.front_axle_x_m * along, similar.rear_axle_x_m * along, similar.track_m * across)

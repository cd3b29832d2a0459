"""A folder of foreign vehicles as additional models of the catalogue, with their axles as their tyres show them."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from assets.errors import AssetError
from assets.external.manifest import VehicleEntry, read_manifest
from assets.external.material_words import sort_material
from assets.external.reading import MeshFile, read_mesh_file
from assets.external.standing import stand
from assets.materials import material_index
from assets.mesh import Mesh
from assets.models.catalogue import CATALOGUE, Body, Kind, ModelSpec
from assets.shapes import clean

_LOG = logging.getLogger(__name__)
_OTHERWISE = "car_paint"  # the largest surface of a vehicle
_BODIES: dict[Kind, Body] = {
    "car": "saloon",
    "van": "van",
    "truck": "truck",
    "bus": "bus",
    "tram": "tram",
    "motorcycle": "motorcycle",
    "cyclist": "bicycle",
    "pedestrian": "pedestrian",
    "person_sitting": "person_sitting",
}
MOST_STRETCH = 1.25
_TYRE_GAP_M = 0.08  # between the tyres of one axle and the next, seen from the side
_GROUNDED_M = 0.3  # a tyre or its rim reaches below this; a spare wheel does not
_AXLE_GROUP_M = 2.0  # axles nearer than this to the rearmost belong to its group
_NARROWEST_TRACK_M = 0.5


@dataclass(frozen=True, eq=False)
class ExternalModels:
    """Foreign models by name; `ExternalModels()` holds none.

    Attributes:
        specs: name → what the catalogue would say of it; the box is that of the mesh.
        meshes: name → mesh in our frame, its bounds exactly the box of the spec, materials of our table.
    """

    specs: Mapping[str, ModelSpec] = field(default_factory=dict)
    meshes: Mapping[str, Mesh] = field(default_factory=dict)

    def of_size(self, kind: str, size_m: np.ndarray) -> list[ModelSpec]:
        """Models of a kind that reach a size (3,) with every side stretched or shrunk by at most a quarter."""
        return [
            spec for spec in self.specs.values() if spec.kind == kind and stretch(spec, size_m) <= np.log(MOST_STRETCH)
        ]


def stretch(spec: ModelSpec, size_m: np.ndarray) -> float:
    """Largest relative change of a side that makes a model fit a size: |ln(size / own)|."""
    return float(np.abs(np.log(np.divide(size_m, spec.size_m))).max())


def load_external(folder: Path | None) -> ExternalModels:
    """All vehicles of a folder with a `vehicles.yaml`; none if there is no folder.

    Raises:
        AssetError: the manifest or a mesh cannot be used; the line names the file.
    """
    if folder is None:
        return ExternalModels()
    specs, meshes = {}, {}
    for entry in read_manifest(folder):
        content = read_mesh_file(folder, entry.file)
        mesh = _build(content, entry, folder / entry.file)
        specs[entry.name], meshes[entry.name] = _spec(entry, mesh), mesh
        if not any(
            stretch(spec, np.array(specs[entry.name].size_m)) <= np.log(MOST_STRETCH)
            for spec in CATALOGUE.values()
            if spec.kind == entry.kind
        ):
            _LOG.warning("%s: no %s in the traffic is within a quarter of its size: never seen", entry.file, entry.kind)
    return ExternalModels(specs, meshes)


def _build(content: MeshFile, entry: VehicleEntry, file: Path) -> Mesh:
    parts, unsorted = [], set()
    for part, mesh in zip(content.parts, stand(content, entry, file), strict=True):
        material = entry.materials.get(part.names[0]) or next(filter(None, map(sort_material, part.names)), None)
        if material is None:
            unsorted.add(next(filter(None, part.names), "without a name"))
        parts.append(Mesh.of(mesh.vertices, mesh.faces, material or _OTHERWISE))
    if unsorted:
        _LOG.warning(
            "%s: materials taken for body paint: %s; name them under materials: if they are not",
            *(file, ", ".join(sorted(unsorted))),
        )
    whole = clean(Mesh.merge(parts))
    if not len(whole.faces):
        raise AssetError(f"{file}: all its faces are without area; export it again")
    return whole


def _spec(entry: VehicleEntry, mesh: Mesh) -> ModelSpec:
    length, width, height = (float(side) for side in np.ptp(mesh.bounds, axis=0))
    axles = _find_axles(mesh, entry.kind)
    walks = entry.kind in ("pedestrian", "person_sitting")
    return ModelSpec(
        name=entry.name,
        kind=entry.kind,
        body=_BODIES[entry.kind],
        length_m=length,
        width_m=width,
        height_m=height,
        wheelbase_m=0.0 if walks else axles.front_x_m - axles.rear_x_m,
        front_axle_x_m=axles.front_x_m,
        rear_axle_x_m=axles.rear_x_m,
        track_m=axles.track_m,
        variant=0,
    )


@dataclass(frozen=True)
class _Axles:
    """Positions along x of the front axle and of the rearmost axle group, and the track; 0 track: one wheel wide."""

    front_x_m: float
    rear_x_m: float
    track_m: float


def _find_axles(mesh: Mesh, kind: Kind) -> _Axles:
    """The axles of a vehicle mesh in our frame."""
    for material in ("tyre", "wheel_rim"):
        found = _from_wheels(mesh, material)
        if found is not None:
            return found
    return _from_proportions(mesh, kind)


def _from_wheels(mesh: Mesh, material: str) -> _Axles | None:
    faces = mesh.faces[mesh.materials == material_index(material)]
    if not len(faces):
        return None
    corners = mesh.vertices[faces].astype(np.float64)
    low, high = corners[..., 0].min(1), corners[..., 0].max(1)
    order = np.argsort(low)
    reach = np.maximum.accumulate(high[order])
    run = np.concatenate([[0], np.cumsum(low[order][1:] > reach[:-1] + _TYRE_GAP_M)])
    axles = []
    for number in range(run[-1] + 1):
        wheels = corners[order[run == number]].reshape(-1, 3)
        if wheels[:, 2].min() < _GROUNDED_M + mesh.bounds[0, 2]:
            axles.append(wheels)
    if len(axles) < 2:
        return None
    middles = np.array([(wheels[:, 0].min() + wheels[:, 0].max()) / 2 for wheels in axles])
    last = middles[(middles < middles.min() + _AXLE_GROUP_M) & (middles < middles.max())]
    return _Axles(float(middles.max()), float(last.mean()), _track_of(axles[int(middles.argmax())][:, 1]))


def _track_of(y: np.ndarray) -> float:
    if y.min() > -_NARROWEST_TRACK_M / 2 or y.max() < _NARROWEST_TRACK_M / 2:
        return 0.0
    left, right = y[y > 0], y[y < 0]
    return float((left.min() + left.max()) / 2 - (right.min() + right.max()) / 2)


def _from_proportions(mesh: Mesh, kind: Kind) -> _Axles:
    """Those of the most similar catalogue model of the kind, stretched to the mesh's box."""
    size = np.ptp(mesh.bounds, axis=0).astype(np.float64)
    similar = min(
        (spec for spec in CATALOGUE.values() if spec.kind == kind),
        key=lambda spec: float(np.abs(np.log(size / np.array(spec.size_m))).max()),
    )
    along, across = size[0] / similar.length_m, size[1] / similar.width_m
    return _Axles(similar.front_axle_x_m * along, similar.rear_axle_x_m * along, similar.track_m * across)

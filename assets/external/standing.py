"""From a file's axes and unit to our frame: x forward, y left, z up, origin on the ground below the box's centre."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from assets.errors import AssetError
from assets.external.manifest import VehicleEntry
from assets.external.reading import MeshFile, MeshPart
from assets.mesh import Mesh

_ROWS = {"x": 0, "y": 1, "z": 2}
_SMALLEST_M, _LARGEST_M = 0.2, 30.0
_LONG = ("car", "van", "truck", "bus", "tram", "motorcycle", "cyclist")  # kinds that are longer than wide


def axes_matrix(forward: str, up: str) -> np.ndarray:
    """(3, 3) rotation from file axes to ours; the axes are written `x`, `+x`, `-x` and so on.

    Raises:
        ValueError: both are the same axis.
    """
    x, z = _unit(forward), _unit(up)
    if x @ z:
        raise ValueError(f"forward {forward} and up {up} are the same axis")
    return np.stack([x, np.cross(z, x), z])


def stand(content: MeshFile, entry: VehicleEntry, file: Path) -> list[Mesh]:
    """The parts of a mesh file in our frame, in metres, as meshes whose materials are not sorted yet.

    Raises:
        AssetError: the axes agree, an extent is zero, or the size cannot be that of such a road user.
    """
    forward, up = entry.forward or content.forward, entry.up or content.up
    if forward is None or up is None:
        raise AssetError(f"{file}: the file does not define its axes; state forward and up in the manifest")
    try:
        turn = axes_matrix(forward, up)
    except ValueError as error:
        raise AssetError(f"{file}: {error}; give two different axes in the manifest") from None
    used = [(vertices @ turn.T, faces) for vertices, faces in map(_used, content.parts)]
    low = np.min([vertices.min(0) for vertices, _ in used], axis=0)
    high = np.max([vertices.max(0) for vertices, _ in used], axis=0)
    size = high - low
    if not (size > 1e-9 * size.max()).all():
        raise AssetError(f"{file}: is flat, its extent is {_text(size)} units; a vehicle has length, width and height")
    scale = _scale(size, entry, content.unit_m)
    _demand_plausible(size * scale, entry, file)
    base = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    return [Mesh.of((vertices - base) * scale, faces, "car_paint") for vertices, faces in used]


def _used(part: MeshPart) -> tuple[np.ndarray, np.ndarray]:
    """The vertices that faces name, and the faces in their rows; the others may lie anywhere."""
    rows, faces = np.unique(part.faces, return_inverse=True)
    return part.vertices[rows], faces.reshape(-1, 3)


def _scale(size: np.ndarray, entry: VehicleEntry, unit_m: float) -> np.ndarray:
    """Metres in a unit along each of our axes: (3,)."""
    wanted = np.array([np.nan if side is None else side for side in (entry.length_m, entry.width_m, entry.height_m)])
    given = np.isfinite(wanted)
    if not given.any():
        return np.full(3, entry.unit_m or unit_m)
    factors = wanted / size
    rest = entry.unit_m or float(np.exp(np.log(factors[given]).mean()))
    return np.where(given, factors, rest)


def _demand_plausible(size_m: np.ndarray, entry: VehicleEntry, file: Path) -> None:
    if size_m.min() < _SMALLEST_M or size_m.max() > _LARGEST_M:
        raise AssetError(
            f"{file}: measures {_text(size_m)} m (length × width × height), no size of a {entry.kind}; "
            "give unit_m (0.01 for centimetres) or length_m in the manifest"
        )
    if entry.kind in _LONG and size_m[0] < size_m[1]:
        raise AssetError(
            f"{file}: measures {_text(size_m)} m (length × width × height), wider than long for a {entry.kind}; "
            "correct forward or up in the manifest"
        )


def _unit(axis: str) -> np.ndarray:
    vector = np.zeros(3)
    vector[_ROWS[axis[-1]]] = -1.0 if axis.startswith("-") else 1.0
    return vector


def _text(size: np.ndarray) -> str:
    return " × ".join(f"{side:.4g}" for side in size)

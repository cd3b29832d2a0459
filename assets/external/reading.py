"""Mesh files as parts of one material each, in the file's own axes and unit. Nothing outside the folder is opened."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from assets.errors import AssetError
from assets.external.wavefront import parse_obj
from assets.gltf_buffers import referenced_buffers

_LARGEST_BYTES = 256 << 20
_MOST_FACES = 4_000_000


@dataclass(frozen=True, eq=False)
class MeshPart:
    """Triangles of one material.

    Attributes:
        vertices: (n, 3) float64, file axes and unit.
        faces: (m, 3) int64.
        names: what the file calls the material, then the object that wears it; blanks where it does not.
    """

    vertices: np.ndarray
    faces: np.ndarray
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class MeshFile:
    """Contents of a mesh file.

    Attributes:
        parts: at least one, all with faces.
        up: the axis that points up according to the format or the file; None if neither defines it.
        forward: likewise, the axis vehicles face.
        unit_m: metres in a unit.
    """

    parts: tuple[MeshPart, ...]
    up: str | None
    forward: str | None
    unit_m: float


def read_mesh_file(folder: Path, name: str) -> MeshFile:
    """The triangles of `folder/name`, node transforms applied.

    Raises:
        AssetError: it is missing, outside the folder, too large, unreadable, without faces, or has vertices that
            are NaN or infinite.
    """
    file = folder / name
    data = _read(folder, file)
    kind = file.suffix.lower()
    try:
        found = _READERS[kind](data, file)
    except AssetError:
        raise
    except Exception as error:  # noqa: BLE001 - parsers raise whatever they meet in a broken file
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise AssetError(f"{file}: not a readable {kind} file ({reason}); export it again") from None
    parts = tuple(part for part in found.parts if len(part.faces))
    if not parts:
        raise AssetError(f"{file}: has no faces; export it with its surfaces (skinned meshes: apply the pose first)")
    if sum(len(part.faces) for part in parts) > _MOST_FACES:
        raise AssetError(f"{file}: more than {_MOST_FACES:,} triangles; simplify it")
    for part in parts:
        bad = int((~np.isfinite(part.vertices).all(1)).sum())
        if bad:
            raise AssetError(f"{file}: {bad} of {len(part.vertices)} vertices are NaN or infinite; repair the mesh")
        if part.faces.min() < 0 or part.faces.max() >= len(part.vertices):
            raise AssetError(f"{file}: a face names vertex {part.faces.max()} of {len(part.vertices)}; repair the mesh")
    return MeshFile(parts, found.up, found.forward, found.unit_m)


def _read(folder: Path, file: Path) -> bytes:
    if not file.resolve().is_relative_to(folder.resolve()):
        raise AssetError(f"{file}: leads out of {folder}; put the mesh itself into the folder")
    try:
        size = file.stat().st_size
        if size > _LARGEST_BYTES:
            raise AssetError(f"{file}: {size >> 20} MiB, more than the {_LARGEST_BYTES >> 20} MiB allowed; simplify it")
        return file.read_bytes()
    except FileNotFoundError:
        raise AssetError(f"{file}: no such mesh; correct the path in the manifest, or remove the entry") from None
    except OSError as error:
        raise AssetError(f"{file}: cannot be read ({error.strerror})") from None


def _read_gltf(data: bytes, file: Path) -> MeshFile:
    import trimesh  # slow to import

    kind = file.suffix.lower().lstrip(".")
    scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=referenced_buffers(file), process=False)
    parts = []
    for node in sorted(scene.graph.nodes_geometry):
        pose, key = scene.graph[node]
        shape = scene.geometry[key]
        if not isinstance(shape, trimesh.Trimesh):
            continue  # lines and points have no surface
        material = getattr(getattr(shape.visual, "material", None), "name", None)
        faces = shape.faces if np.linalg.det(pose[:3, :3]) > 0 else shape.faces[:, ::-1]
        vertices = np.asarray(shape.vertices, np.float64) @ pose[:3, :3].T + pose[:3, 3]
        parts.append(MeshPart(vertices, np.asarray(faces, np.int64), (str(material or ""), str(key), str(node))))
    return MeshFile(tuple(parts), "+y", "+z", 1.0)  # glTF 2.0 § 3.4: +Y up, the front of an asset faces +Z, metres


def _read_obj(data: bytes, file: Path) -> MeshFile:
    parts = tuple(
        MeshPart(vertices, faces, (name,)) for vertices, faces, name in parse_obj(data.decode("utf-8", "replace"))
    )
    return MeshFile(parts, None, None, 1.0)


def _read_dae(data: bytes, file: Path) -> MeshFile:
    import collada
    from collada.common import DaeBrokenRefError, DaeUnsupportedError

    if b"<!DOCTYPE" in data or b"<!ENTITY" in data or not data.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
        raise AssetError(f"{file}: not plain XML, or XML with a DOCTYPE or ENTITY, which is not accepted; remove it")
    document = collada.Collada(io.BytesIO(data), ignore=[DaeUnsupportedError, DaeBrokenRefError])
    parts = []
    for bound in document.scene.objects("geometry") if document.scene else ():
        for primitive in bound.primitives():
            if hasattr(primitive, "triangleset"):  # polygons
                primitive = primitive.triangleset()
            if not hasattr(primitive, "ntriangles") or primitive.vertex_index is None:
                continue  # lines have no surface
            wears = primitive.material
            names = (str(getattr(wears, "name", None) or getattr(wears, "id", None) or ""), str(bound.original.id))
            faces = np.asarray(primitive.vertex_index, np.int64).reshape(-1, 3)
            parts.append(MeshPart(np.asarray(primitive.vertex, np.float64).reshape(-1, 3), faces, names))
    asset: Any = document.assetInfo
    up = {"X_UP": "+x", "Z_UP": "+z"}.get(str(asset.upaxis), "+y")  # COLLADA 1.4.1: Y_UP by default
    return MeshFile(tuple(parts), up, None, float(asset.unitmeter or 1.0))


_READERS: dict[str, Callable[[bytes, Path], MeshFile]] = {
    ".glb": _read_gltf,
    ".gltf": _read_gltf,
    ".obj": _read_obj,
    ".dae": _read_dae,
}

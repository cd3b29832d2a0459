"""Meshes as binary glTF 2.0, one mesh a material.

glTF is y-up: (x, y, z) of the world is (x, −z, y) of the file, on the way in and out. Written by hand rather
than by a library, so that material names, their order and every byte are ours: equal meshes give equal files.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from assets.gltf_buffers import referenced_buffers
from assets.materials import MATERIAL_NAMES, MATERIALS, TABLE, MaterialTable
from assets.mesh import Mesh
from cosim.drives.files import read_bytes
from cosim.errors import FormatError

_MAGIC, _VERSION = b"glTF", 2
_FLOAT, _UINT = 5126, 5125  # componentType
_VERTICES, _INDICES = 34962, 34963  # bufferView target
_GLASS_ALPHA = 0.35
_WORLD_FROM_GLTF = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)


def encode_glb(mesh: Mesh, name: str = "world") -> bytes:
    """The bytes of a `.glb` file.

    Args:
        mesh: written as float32 positions and uint32 indices, one node, mesh and material a material name in
            use, in the order of the material table; materials carry their name and visible colour.
        name: the node above them.
    """
    document, binary = _Document(name), list[bytes]()
    for material, part in _parts(mesh):
        positions = np.stack([part.vertices[:, 0], part.vertices[:, 2], -part.vertices[:, 1]], -1)
        positions = positions + np.float32(0)  # no negative zeros: nearly equal worlds, equal bytes
        document.add(material, positions, part.faces, _size(binary))
        binary += [positions.astype("<f4").tobytes(), part.faces.astype("<u4").tobytes()]
    content = json.dumps(document.finished(_size(binary)), separators=(",", ":")).encode()
    content += b" " * (-len(content) % 4)
    chunks = [struct.pack("<I4s", len(content), b"JSON"), content]
    if binary:
        chunks += [struct.pack("<I4s", _size(binary), b"BIN\0"), *binary]
    return b"".join([struct.pack("<4sII", _MAGIC, _VERSION, 12 + _size(chunks)), *chunks])


def _size(parts: list[bytes]) -> int:
    """Number of bytes of all parts."""
    return sum(map(len, parts))


def write_glb(path: str | Path, mesh: Mesh, name: str = "world") -> None:
    """Write a `.glb` file; see `encode_glb`."""
    Path(path).write_bytes(encode_glb(mesh, name))


def read_glb(path: str | Path, materials: Mapping[str, str] | None = None, table: MaterialTable = TABLE) -> Mesh:
    """The triangles of a `.glb` or `.gltf` file of any origin, in world axes, node transforms applied.

    Args:
        path: the file.
        materials: names in the file → names of the material table, for those that are not in it.
        table: the material table.

    Raises:
        FormatError: the file cannot be read, or has material names that are neither in the table nor mapped.
    """
    parts, unknown = [], set()
    for pose, shape in _shapes(path):
        label = _material_name(shape)
        material = (materials or {}).get(label, label)
        if material not in table:
            unknown.add(label)
            continue
        try:
            parts.append(Mesh.of(shape.vertices, shape.faces, material, table).transformed(_WORLD_FROM_GLTF @ pose))
        except ValueError as error:
            raise FormatError(f"{path}: the mesh of material {label!r} is broken: {error}; export it again") from None
    if unknown:
        raise FormatError(
            f"{path}: material names {', '.join(map(repr, sorted(unknown)))} are not in the material table; "
            "rename them in the file, or give a mapping to names of the table (assets/materials.py)"
        )
    return Mesh.merge(parts)


def material_names(path: str | Path) -> tuple[str, ...]:
    """Names of the materials that faces of a `.glb` or `.gltf` file wear, sorted; empty for those without.

    Raises:
        FormatError: the file cannot be read.
    """
    return tuple(sorted({_material_name(shape) for _, shape in _shapes(path)}))


def _shapes(path: str | Path) -> list[tuple[np.ndarray, Any]]:
    """Poses (4, 4) and trimesh's meshes of a file, in its order."""
    import trimesh  # slow to import, and needed for reading only

    file = Path(path)
    data = read_bytes(file)
    kind = file.suffix.lower().lstrip(".")
    if kind == "glb" and data[:4] != _MAGIC:
        raise FormatError(f"{path}: not a binary glTF file (starts with {data[:4]!r}); export it as .glb")
    try:
        scene = trimesh.load_scene(io.BytesIO(data), process=False, file_type=kind, resolver=referenced_buffers(file))
        shapes = [scene.graph[node] for node in scene.graph.nodes_geometry]
    except Exception as error:  # noqa: BLE001 - trimesh raises whatever its parsers meet in a broken file
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise FormatError(f"{path}: not a readable glTF file ({reason})") from None
    found = ((pose, scene.geometry[key]) for pose, key in reversed(shapes))  # trimesh lists the last node first
    return [(pose, shape) for pose, shape in found if isinstance(shape, trimesh.Trimesh)]  # lines have no surface


class _Document:
    """The JSON half of a glTF file, grown mesh by mesh."""

    def __init__(self, name: str) -> None:
        self._root = name
        self._nodes: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._views: list[dict[str, Any]] = []

    def add(self, material: str, positions: np.ndarray, faces: np.ndarray, offset: int) -> None:
        """Describe a mesh whose positions, then indices, start at byte `offset`."""
        row = len(self._meshes)
        bounds = {"min": positions.min(0).tolist(), "max": positions.max(0).tolist()}
        for array, target in ((positions, _VERTICES), (faces, _INDICES)):
            view = {"buffer": 0, "byteOffset": offset, "byteLength": 4 * array.size, "target": target}
            self._views.append(view)
            offset += 4 * array.size
        vertices = {"componentType": _FLOAT, "count": len(positions), "type": "VEC3", **bounds}
        indices = {"componentType": _UINT, "count": faces.size, "type": "SCALAR"}
        self._accessors += [{"bufferView": 2 * row, **vertices}, {"bufferView": 2 * row + 1, **indices}]
        primitive = {"attributes": {"POSITION": 2 * row}, "indices": 2 * row + 1, "material": row, "mode": 4}
        self._meshes.append({"name": material, "primitives": [primitive]})
        self._nodes.append({"name": material, "mesh": row})
        self._materials.append(_material_json(material))

    def finished(self, size: int) -> dict[str, Any]:
        """The document, for a binary chunk of `size` bytes."""
        root: dict[str, Any] = {"name": self._root}
        document: dict[str, Any] = {"asset": {"version": "2.0", "generator": "cosim"}, "scene": 0}
        document["scenes"] = [{"name": self._root, "nodes": [len(self._nodes)]}]
        if self._nodes:
            root["children"] = list(range(len(self._nodes)))
        document["nodes"] = [*self._nodes, root]
        if self._nodes:  # glTF forbids empty lists
            document |= {"meshes": self._meshes, "materials": self._materials, "accessors": self._accessors}
            document |= {"bufferViews": self._views, "buffers": [{"byteLength": size}]}
        return document


def _material_json(name: str) -> dict[str, Any]:
    material = MATERIALS[name]
    glass = material.kind == "glass"
    colour = [*material.rgb, _GLASS_ALPHA if glass else 1.0]
    surface = {
        "baseColorFactor": colour,
        "metallicFactor": 0.6 if material.metal else 0.0,
        "roughnessFactor": 0.1 if glass else 0.8,
    }
    entry: dict[str, Any] = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True}
    return entry | ({"alphaMode": "BLEND"} if glass else {})


def _parts(mesh: Mesh) -> Iterator[tuple[str, Mesh]]:
    """The faces of each material in use with only the vertices they touch, in table order."""
    order = np.argsort(mesh.materials, kind="stable")
    starts = np.searchsorted(mesh.materials[order], np.arange(len(MATERIAL_NAMES) + 1))
    row_of = np.zeros(len(mesh.vertices), np.int32)
    for index, name in enumerate(MATERIAL_NAMES):
        faces = mesh.faces[order[starts[index] : starts[index + 1]]]
        if not len(faces):
            continue
        used = _used(faces, len(mesh.vertices))
        row_of[used] = np.arange(len(used), dtype=np.int32)
        yield name, Mesh.of(mesh.vertices[used], row_of[faces], name)


def _used(faces: np.ndarray, vertices: int) -> np.ndarray:
    if faces.size * 8 < vertices:
        return np.unique(faces)
    mask = np.zeros(vertices, bool)
    mask[faces] = True
    return np.flatnonzero(mask)


def _material_name(shape: Any) -> str:
    material = getattr(shape.visual, "material", None)
    name = getattr(material, "name", None)
    return name if isinstance(name, str) else ""

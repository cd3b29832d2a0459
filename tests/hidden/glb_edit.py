"""Changes to binary glTF files as bytes: vertices moved, materials renamed."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

_TYPES = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}


def move_vertices(source: Path, target: Path, shift: Callable[[np.ndarray], np.ndarray]) -> None:
    """Copy a file with `shift(points)` (n, 3) added to its vertices, in the file's axes."""
    document, binary = _chunks(source)
    rows = {part["attributes"]["POSITION"] for mesh in document["meshes"] for part in mesh["primitives"]}
    for row in rows:
        accessor, start = document["accessors"][row], _start(document, row)
        points = _column(document, binary, row).reshape(-1, 3)
        moved = (points + shift(points)).astype("<f4")
        accessor["min"], accessor["max"] = moved.min(0).tolist(), moved.max(0).tolist()
        binary[start : start + moved.nbytes] = moved.tobytes()
    _write(target, document, binary)


def read_triangles(source: Path) -> tuple[np.ndarray, np.ndarray]:
    """All vertices (n, 3) in the file's axes, and triangles (m, 3) of them; nodes must not turn or move meshes."""
    document, binary = _chunks(source)
    start: dict[int, int] = {}
    points, triangles = [], []
    for part in (part for mesh in document["meshes"] for part in mesh["primitives"]):
        row = part["attributes"]["POSITION"]
        if row not in start:
            start[row] = sum(map(len, points))
            points.append(_column(document, binary, row).reshape(-1, 3))
        triangles.append(start[row] + _column(document, binary, part["indices"]).astype(np.int64).reshape(-1, 3))
    return np.concatenate(points), np.concatenate(triangles)


def rename_materials(source: Path, target: Path, names: Mapping[str, str]) -> None:
    """Copy a file with other names for its materials."""
    document, binary = _chunks(source)
    for material in document.get("materials", []):
        material["name"] = names[material["name"]]
    _write(target, document, binary)


def _start(document: dict, row: int) -> int:
    accessor = document["accessors"][row]
    return document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get("byteOffset", 0)


def _column(document: dict, binary: bytearray, row: int) -> np.ndarray:
    accessor = document["accessors"][row]
    numbers = accessor["count"] * {"SCALAR": 1, "VEC3": 3}[accessor["type"]]
    return np.frombuffer(binary, _TYPES[accessor["componentType"]], numbers, _start(document, row))


def _chunks(path: Path) -> tuple[dict, bytearray]:
    data = path.read_bytes()
    size = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + size]), bytearray(data[28 + size :])


def _write(path: Path, document: dict, binary: bytearray) -> None:
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)

"""A twin as outside tools read it: trimesh, JSON and YAML, nothing of the simulator."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
import yaml

_WORLD_FROM_GLTF = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@dataclass(frozen=True, eq=False)
class Soup:
    """Triangles without order.

    Attributes:
        corners: (m, 3, 3) float32, world or model axes [m].
        material: (m,) int16 rows of the twin's material table.
    """

    corners: np.ndarray
    material: np.ndarray

    def part(self, mask: np.ndarray) -> Soup:
        """The triangles of a mask."""
        return Soup(self.corners[mask], self.material[mask])


class MaterialTable:
    """`materials.yaml` by column; rows are in the order of the file."""

    def __init__(self, path: Path) -> None:
        entries = yaml.safe_load(path.read_text())
        self.names = list(entries)
        rows = list(entries.values())
        self.row = {name: row for row, name in enumerate(self.names)}
        self.reflectance = np.array([row["reflectance"] for row in rows], np.float32)
        self.albedo = np.array([row["albedo"] for row in rows], np.float32)
        self.glass = np.array([row["class"] == "glass" for row in rows])
        self.retro, self.metal, self.road, self.paint = (
            np.array([bool(row.get(key)) for row in rows]) for key in ("retro", "metal", "road", "paint")
        )


def read_soup(path: Path, table: MaterialTable) -> Soup:
    """All triangles of a `.glb` in world axes."""
    scene = trimesh.load_scene(str(path), process=False)
    corners, material = [], []
    for node in scene.graph.nodes_geometry:
        pose, key = scene.graph[node]
        mesh = scene.geometry[key]
        points = (mesh.vertices @ pose[:3, :3].T + pose[:3, 3]) @ _WORLD_FROM_GLTF.T
        corners.append(points[mesh.faces].astype(np.float32))
        material.append(np.full(len(mesh.faces), table.row[mesh.visual.material.name], np.int16))
    return Soup(np.concatenate(corners), np.concatenate(material))


def read_frames(drive: Path, limit: int | None = None) -> list[dict]:
    """The frames of `twin/frames`, in order."""
    paths = sorted((drive / "twin" / "frames").glob("*.json"))[:limit]
    return [json.loads(path.read_text()) for path in paths]


def read_pattern(drive: Path) -> dict:
    """`pattern.yaml`."""
    return yaml.safe_load((drive / "pattern.yaml").read_text())

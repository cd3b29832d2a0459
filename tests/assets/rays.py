"""Rays against a model for the tests: the surfaces a ray meets, in order."""

from __future__ import annotations

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

from assets.mesh import Mesh


def first_hits(mesh: Mesh, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Range (n,), infinite for a miss, and face (n,), −1 for a miss."""
    scene = rtcore_scene.EmbreeScene(robust=True)
    TriangleMesh(scene, mesh.vertices, mesh.faces)
    origins = np.ascontiguousarray(origins, np.float32)
    directions = np.ascontiguousarray(np.broadcast_to(directions, origins.shape), np.float32)
    hits = scene.run(origins, directions, dists=None, query="INTERSECT", output=True)
    face = np.asarray(hits["primID"])
    return np.where(face >= 0, hits["tfar"], np.inf), face


def glass_then_solid(mesh: Mesh, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Range to the first glass and to the first opaque face, (n,) each, infinite for none."""
    opaque, glass = mesh.split_glass()
    return first_hits(glass, origins, directions)[0], first_hits(opaque, origins, directions)[0]

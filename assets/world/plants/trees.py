"""Trees, bushes and hedges: trunks and branches with leaf clusters a LiDAR beam can pass between."""

from __future__ import annotations

import numpy as np

from assets.materials import material_index
from assets.mesh import Mesh
from assets.shapes import box

_FOLIAGE = ("foliage", "foliage_dark")


def broadleaf(
    rng: np.random.Generator,
    height_m: float,
    crown_m: tuple[float, float],
    clear_m: float,
    clusters: int = 135,
    *,
    fine: bool = True,
) -> Mesh:
    """A deciduous tree.

    Args:
        rng: source of its shape.
        height_m: full height.
        crown_m: crown radius at mid-height in x and y.
        clear_m: height of the lowest leaves.
        clusters: leaf clusters.
        fine: whether a cluster is three leaves, for trees that are seen from near, or one.
    """
    radii = np.array([*crown_m, (height_m - clear_m) / 2])
    middle = np.array([0.0, 0.0, clear_m + radii[2]])
    trunk = spike(np.zeros(3), middle * [1.0, 1.0, 1.15], 0.018 * height_m, sides=6)
    branches = []
    for turn in rng.uniform(0, 2 * np.pi) + np.arange(3) * 2 * np.pi / 3:
        tip = middle + radii * 0.62 * np.array([np.cos(turn), np.sin(turn), rng.uniform(-0.3, 0.5)])
        fork = np.array([0.0, 0.0, clear_m * rng.uniform(0.85, 1.05)])
        branches.append(spike(fork, tip, 0.008 * height_m, sides=3))
    leaves = leaf_clusters(rng, middle, radii, clusters, 2.9 / np.sqrt(clusters) * float(radii.mean()))
    return Mesh.merge([trunk, *branches, leaflets(leaves) if fine else leaves])


def conifer(rng: np.random.Generator, height_m: float, radius_m: float, tiers: int = 7) -> Mesh:
    """A spruce: drooping boughs in tiers around a straight trunk."""
    trunk = spike(np.zeros(3), np.array([0, 0, height_m]), 0.02 * height_m, sides=5)
    boughs = []
    for tier in range(tiers):
        share = tier / tiers
        reach = radius_m * (1.0 - share) + 0.15
        level = height_m * (0.12 + 0.80 * share)
        count = max(5, round(9 * (1 - 0.5 * share)))
        turn = rng.uniform(0, 2 * np.pi) + (np.arange(count) + rng.uniform(-0.2, 0.2, count)) * 2 * np.pi / count
        spread = 0.9 * np.pi / count
        drop = height_m * 0.07 * rng.uniform(0.7, 1.3, count)
        root = np.column_stack([np.zeros((count, 2)), np.full(count, level + 0.12 * height_m)])
        tips = [
            np.column_stack([reach * k * np.cos(turn + d), reach * k * np.sin(turn + d), level - drop * k])
            for d, k in ((-spread, 0.85), (0.0, 1.1), (spread, 0.85))
        ]
        index = np.arange(count)[:, None]
        faces = np.concatenate([index + np.array(row) * count for row in ([0, 1, 2], [0, 2, 3])])
        boughs.append(Mesh.of(np.concatenate([root, *tips]), faces, "foliage_dark"))
    return Mesh.merge([trunk, *boughs])


def bush(rng: np.random.Generator, height_m: float, radius_m: float) -> Mesh:
    """A shrub down to the ground."""
    radii = np.array([radius_m, radius_m, height_m / 2])
    return leaflets(leaf_clusters(rng, np.array([0, 0, height_m * 0.48]), radii, 28, 0.57 * radius_m))


def shrub(rng: np.random.Generator, height_m: float, radius_m: float) -> Mesh:
    """A tall shrub such as elder or hazel: leaves from near the ground up, on three stems."""
    radii = np.array([radius_m, radius_m * rng.uniform(0.8, 1.2), height_m / 2])
    middle = np.array([0, 0, height_m * 0.52])
    stems = [
        spike(np.zeros(3), middle + 0.8 * radii * [np.cos(turn), np.sin(turn), 0.5], 0.05, sides=3)
        for turn in rng.uniform(0, 2 * np.pi) + np.arange(3) * 2 * np.pi / 3
    ]
    return Mesh.merge([*stems, leaflets(leaf_clusters(rng, middle, radii, 44, 0.48 * radius_m))])


def climber(rng: np.random.Generator, width_m: float, height_m: float, per_m2: float = 5.0) -> Mesh:
    """Ivy or vine on a wall: leaves along x from 0 to `width_m`, y up to 0.25 m before the wall, dense below."""
    count = max(6, round(per_m2 * width_m * height_m))
    up = height_m * rng.random(count) ** 1.3
    taper = 1.0 - 0.6 * (up / height_m) ** 2
    across = width_m * (0.5 + (rng.random(count) - 0.5) * taper)
    centre = np.column_stack([across, rng.uniform(0.05, 0.25, count), up])
    normal = np.column_stack([rng.normal(0, 0.4, count), np.ones(count), rng.normal(0.2, 0.4, count)])
    return leaflets(_leaves(rng, centre, normal, rng.uniform(0.2, 0.34, count), rng.random(count) < 0.6))


def hedge(rng: np.random.Generator, length_m: float, width_m: float, height_m: float) -> Mesh:
    """A clipped hedge along x from 0 to `length_m`: a dense core with loose leaves on its faces."""
    core = box((length_m, width_m * 0.8, height_m * 0.95), (length_m / 2, 0, height_m * 0.47), "hedge")
    count = round(2.4 * length_m)
    side = rng.choice([-1.0, 1.0], count)
    top = rng.random(count) < 0.35
    centre = np.column_stack(
        [
            rng.uniform(0, length_m, count),
            np.where(top, rng.uniform(-0.4, 0.4, count), side * 0.45) * width_m,
            np.where(top, 1.0, rng.uniform(0.1, 0.95, count)) * height_m,
        ]
    )
    normal = np.column_stack([np.zeros(count), np.where(top, 0, side), np.where(top, 1.0, 0.2)])
    leaves = _leaves(rng, centre, normal, np.full(count, 0.31), rng.random(count) < 0.3)
    return Mesh.merge([core, leaflets(Mesh(leaves.vertices, leaves.faces, _shaded(leaves.materials)))])


def leaflets(leaves: Mesh) -> Mesh:
    """Each leaf as three smaller ones at its corners, bent out of its plane, with a gap between them.

    Their shapes depend only on the number of leaves, so that positions of plants do not change.
    """
    rng = np.random.default_rng(len(leaves.faces))
    corners = leaves.triangles.astype(np.float64)
    count = len(corners)
    reach = np.linalg.norm(corners - corners.mean(1, keepdims=True), axis=2).mean(1)
    pieces = []
    for corner in range(3):
        share = rng.uniform(0.5, 0.72, (count, 1, 1))
        piece = corners[:, corner : corner + 1] + share * (corners - corners[:, corner : corner + 1])
        bend = rng.uniform(-0.35, 0.35, (count, 3)) * reach[:, None]
        pieces.append(piece + bend[..., None] * leaves.normals[:, None, :])
    return Mesh(
        np.concatenate(pieces).reshape(-1, 3), np.arange(9 * count).reshape(-1, 3), np.tile(leaves.materials, 3)
    )


def _shaded(materials: np.ndarray) -> np.ndarray:
    """Brightness of leaves of a hedge: most are as dark as the hedge, few are bright."""
    few = np.arange(len(materials)) % 4 == 0
    return np.where(few, materials, material_index(_FOLIAGE[1])).astype(materials.dtype)


def spike(root: np.ndarray, tip: np.ndarray, radius_m: float, sides: int) -> Mesh:
    """A trunk or branch from `root` to a point at `tip` (3,), without a cap: `sides` triangles."""
    axis = (tip - root) / np.linalg.norm(tip - root)
    u = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    u /= np.linalg.norm(u)
    angle = 2 * np.pi * np.arange(sides)[:, None] / sides
    ring = root + radius_m * (np.cos(angle) * u + np.sin(angle) * np.cross(axis, u))
    k = np.arange(sides)
    faces = np.stack([k, (k + 1) % sides, np.full(sides, sides)], axis=1)
    return Mesh.of(np.vstack([ring, tip]), faces, "bark")


def leaf_clusters(rng: np.random.Generator, middle: np.ndarray, radii: np.ndarray, count: int, size_m: float) -> Mesh:
    """Loose leaf clusters near the surface of an ellipsoid, with gaps between them.

    About two thirds of the beams that meet one side of the crown stop there; the rest reach the inside,
    the far side, or pass.
    """
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + np.sqrt(5)) * k
    turn = turn + rng.normal(0, 0.35, count)
    normal = np.stack([np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)], axis=1)
    depth = np.where(rng.random(count) < 0.75, rng.uniform(0.82, 1.05, count), rng.uniform(0.45, 0.8, count))
    lumps = 1.0 + 0.12 * np.sin(3 * turn + rng.uniform(0, 6)) * np.sin(polar)
    centre = middle + normal * radii * (depth * lumps)[:, None]
    dark = (depth < 0.8) | (normal[:, 2] < -0.35)
    return _leaves(rng, centre, normal + rng.normal(0, 0.35, (count, 3)), size_m * rng.uniform(0.7, 1.3, count), dark)


def _leaves(
    rng: np.random.Generator, centre: np.ndarray, normal: np.ndarray, size_m: np.ndarray, dark: np.ndarray
) -> Mesh:
    """Irregular triangles of circumradius `size_m` (n,) about `centre` (n, 3), facing `normal`."""
    count = len(centre)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    helper = np.where(np.abs(normal[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    u = np.cross(helper, normal)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normal, u)
    spin = rng.uniform(0, 2 * np.pi, count)
    corners = []
    for third in range(3):
        angle = spin + third * 2 * np.pi / 3 + rng.uniform(-0.35, 0.35, count)
        reach = (size_m * rng.uniform(0.75, 1.25, count))[:, None]
        sag = rng.uniform(-0.25, 0.25, (count, 1)) * reach
        corners.append(centre + reach * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v) + sag * normal)
    k = np.arange(count)
    faces = np.stack([k, k + count, k + 2 * count], axis=1)
    vertices = np.concatenate(corners)
    light, shaded = (material_index(name) for name in _FOLIAGE)
    return Mesh(vertices, faces, np.where(dark, shaded, light))

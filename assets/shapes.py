"""Primitive solids and sheets in metres, each wound counter-clockwise seen from outside.

A shape is at the origin unless a `centre` or path places it; move it with `Mesh.moved` and
`Mesh.transformed`. Every function drops faces without area, so poles and pinched rows need no care.
"""

from __future__ import annotations

from collections.abc import Sequence

import mapbox_earcut  # pyright: ignore[reportMissingImports]
import numpy as np

from assets.mesh import Mesh

Vector = Sequence[float] | np.ndarray

_AXES = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}
_MIN_AREA_M2 = 1e-9


def clean(mesh: Mesh, min_area_m2: float = _MIN_AREA_M2) -> Mesh:
    """The mesh without faces smaller than `min_area_m2` and without unused vertices."""
    a, b, c = np.moveaxis(mesh.triangles.astype(np.float64), 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return mesh.select(area > min_area_m2)


def weld(mesh: Mesh, digits: int = 5) -> Mesh:
    """The mesh with vertices that agree to `digits` decimals of a metre made one."""
    _, first, inverse = np.unique(
        mesh.vertices.astype(np.float64).round(digits) + 0.0, axis=0, return_index=True, return_inverse=True
    )
    return clean(Mesh(mesh.vertices[first], inverse.reshape(-1)[mesh.faces], mesh.materials))


def flipped(mesh: Mesh) -> Mesh:
    """The mesh with every face turned round."""
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], mesh.materials)


def mirrored(mesh: Mesh) -> Mesh:
    """The mesh reflected in the plane y = 0, faces still outward."""
    return mesh.transformed(np.diag([1.0, -1.0, 1.0, 1.0]))


def rotation(axis: str, angle_rad: float, offset: Vector = (0, 0, 0)) -> np.ndarray:
    """Pose (4, 4): turn by `angle_rad` about a coordinate axis (right hand), then shift by `offset`."""
    i, j, _ = _AXES[axis]
    pose = np.eye(4)
    pose[i, i] = pose[j, j] = np.cos(angle_rad)
    pose[j, i] = np.sin(angle_rad)
    pose[i, j] = -pose[j, i]
    pose[:3, 3] = offset
    return pose


def grid_faces(rows: int, columns: int, wrap: bool = False) -> np.ndarray:
    """Two triangles a cell of a (rows, columns) point grid, (m, 3), cells in row order.

    The normal is (row direction) × (column direction); `wrap` joins the last row to the first.
    """
    index = np.arange(rows * columns).reshape(rows, columns)
    if wrap:
        index = np.concatenate([index, index[:1]])
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([a, b, c, a, c, d], -1).reshape(-1, 3)


def quad_strip(points: np.ndarray, material: str, wrap: bool = False) -> Mesh:
    """Sheet through a grid of points (rows, columns, 3); normal is row direction × column direction."""
    points = np.asarray(points, np.float64)
    return clean(Mesh.of(points.reshape(-1, 3), grid_faces(points.shape[0], points.shape[1], wrap), material))


def box(size: Vector, centre: Vector, material: str) -> Mesh:
    """Axis-aligned box of full extents `size` (3,) about `centre` (3,): 12 faces."""
    corners = np.stack(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5], indexing="ij"), -1).reshape(-1, 3)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return Mesh.of(corners * np.asarray(size) + np.asarray(centre), faces, material)


def lathe(profile: np.ndarray, material: str, segments: int = 16, axis: str = "z", phase_rad: float = 0.0) -> Mesh:
    """Profile turned about an axis through the origin.

    Args:
        profile: (k, 2) radius and position along the axis; the outside lies to the right of its course, so
            follow the axis. Ends at radius 0 close the solid.
        material: name of the material.
        segments: corners of a turn.
        axis: `x`, `y` or `z`.
        phase_rad: angle of the first corner.
    """
    profile = np.asarray(profile, np.float64)
    angle = phase_rad + 2 * np.pi * np.arange(segments) / segments
    radius, along = np.broadcast_to(profile, (segments, *profile.shape)).transpose(2, 0, 1)
    local = np.stack([radius * np.cos(angle)[:, None], radius * np.sin(angle)[:, None], along], -1)
    points = np.empty_like(local)
    points[..., list(_AXES[axis])] = local
    return weld(quad_strip(points, material, wrap=True))


def cone(radius: float, top_radius: float, height: float, material: str, segments: int = 16, axis: str = "z") -> Mesh:
    """Closed frustum standing on the origin along `axis`; `top_radius` 0 makes a cone."""
    return lathe(np.array([[0, 0], [radius, 0], [top_radius, height], [0, height]]), material, segments, axis)


def cylinder(radius: float, height: float, material: str, segments: int = 16, axis: str = "z") -> Mesh:
    """Closed cylinder standing on the origin along `axis`."""
    return cone(radius, radius, height, material, segments, axis)


def ellipsoid(radii: Vector, centre: Vector, material: str, segments: int = 12, rings: int = 8) -> Mesh:
    """Ellipsoid of semi-axes `radii` (3,) about `centre` (3,)."""
    polar = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    sphere = lathe(np.stack([np.cos(polar), np.sin(polar)], 1), material, segments)
    return Mesh(sphere.vertices * np.asarray(radii) + np.asarray(centre), sphere.faces, sphere.materials)


def triangulate(polygon: np.ndarray, holes: Sequence[np.ndarray] = ()) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 2) and counter-clockwise faces (m, 3) of a simple polygon with holes."""
    rings = [np.asarray(ring, np.float64)[:, :2] for ring in (polygon, *holes)]
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    points = np.ascontiguousarray(np.concatenate(rings))
    faces = mapbox_earcut.triangulate_float64(points, ends).reshape(-1, 3).astype(np.int64)
    (ax, ay), (bx, by), (cx, cy) = points[faces].transpose(1, 2, 0)
    clockwise = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0
    faces[clockwise] = faces[clockwise][:, ::-1]
    return points, faces


def plate(polygon: np.ndarray, material: str, height_m: float = 0.0, holes: Sequence[np.ndarray] = ()) -> Mesh:
    """Flat sheet facing up at z = `height_m` over a polygon (n, 2)."""
    points, faces = triangulate(polygon, holes)
    return clean(Mesh.of(np.insert(points, 2, height_m, axis=1), faces, material))


def extrude(
    polygon: np.ndarray, height: float, material: str, holes: Sequence[np.ndarray] = (), axis: str = "z"
) -> Mesh:
    """Closed prism over a polygon (n, 2) with holes, from 0 to `height` along `axis`.

    For `axis` z the polygon holds x, y; for x it holds y, z; for y it holds z, x.
    """
    points, faces = triangulate(polygon, holes)
    n = len(points)
    sides, start = [], 0
    for ring in (polygon, *holes):
        index = start + np.arange(len(ring))
        following = np.roll(index, -1)
        x, y = points[index].T
        outer_sign = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) * (1 if start == 0 else -1)
        a, b = (index, following) if outer_sign > 0 else (following, index)
        sides.append(np.stack([a, b, b + n, a, b + n, a + n], 1).reshape(-1, 3))
        start += len(ring)
    local = np.concatenate([np.insert(points, 2, z, axis=1) for z in (0.0, height)])
    vertices = np.empty_like(local)
    vertices[:, list(_AXES[axis])] = local
    return clean(Mesh.of(vertices, np.concatenate([faces[:, ::-1], faces + n, *sides]), material))


def loft(sections: np.ndarray, material: str, caps: bool = True) -> Mesh:
    """Skin over rings (s, n, 3), each counter-clockwise about the direction of advance; caps are fans."""
    sections = np.asarray(sections, np.float64)
    count, n = sections.shape[:2]
    vertices = sections.reshape(-1, 3)
    faces = [grid_faces(n, count, wrap=True)]
    remap = np.arange(count * n).reshape(count, n).T.reshape(-1)
    faces = [remap[faces[0]]]
    if caps:
        i = np.arange(n)
        first, last = count * n, count * n + 1
        vertices = np.concatenate([vertices, sections[[0, -1]].mean(1)])
        faces.append(np.stack([np.full(n, first), np.roll(i, -1), i], 1))
        ring = (count - 1) * n
        faces.append(np.stack([np.full(n, last), ring + i, ring + np.roll(i, -1)], 1))
    return weld(Mesh.of(vertices, np.concatenate(faces), material))


def tube(path: np.ndarray, radius: float | Vector, material: str, segments: int = 8, closed: bool = False) -> Mesh:
    """Round bar along a path (k, 3) of one radius or one a point; `closed` joins the ends, else capped."""
    path = np.asarray(path, np.float64)
    tangent = np.roll(path, -1, 0) - np.roll(path, 1, 0) if closed else np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.empty_like(path)
    helper = np.eye(3)[np.abs(tangent[0]).argmin()]
    for i, direction in enumerate(tangent):  # carry the frame along so that the skin does not twist
        helper = helper - direction * (helper @ direction)
        helper /= np.linalg.norm(helper)
        side[i] = helper
    other = np.cross(tangent, side)
    angle = 2 * np.pi * np.arange(segments) / segments
    radii = np.broadcast_to(np.asarray(radius, np.float64), len(path))[:, None, None]
    ring = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * other[:, None]
    sections = path[:, None] + radii * ring
    if closed:
        return loft(np.concatenate([sections, sections[:1]]), material, caps=False)
    return loft(sections, material)

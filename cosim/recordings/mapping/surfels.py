"""Surfels: small planes that the points of many scans lie on, a cell each.

A cell's plane goes through the mean of its points, along the two larger axes of their scatter (Pauly, Gross, Kobbelt,
Efficient simplification of point-sampled surfaces, IEEE Visualization 2002). A cell is left out where its points lie on
no one plane: an edge, a bush, two surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.drives.twin.surfels import cell_keys, sides
from cosim.recordings.mapping.normals import planes, steadied

_CHUNK = 1_000_000  # points at a time
_SOLID_SIGMAS, _SOLID_LEAST_M, _ABOUT = 3.0, 0.03, 0.75


@dataclass(frozen=True)
class SurfelSettings:
    """Limits that decide which cells are surfaces.

    Attributes:
        cell_m: size of a cell [m].
        least_points: minimum number of points of a cell for a plane.
        least_scans: minimum number of scans of a cell for a thickness.
        thickest_m: standard deviation of points across the plane, at most [m].
        flattest: variance across the plane over the smaller one along it, at most; above, points form no plane.
        least_apart_deg: standard deviation of the elevations at which beams of a surfel leave the sensor, at least, for
            it to be used; points of a single laser lie on its cone, on which range errors are not visible.
    """

    cell_m: float = 0.4
    least_points: int = 12
    least_scans: int = 3
    thickest_m: float = 0.05
    flattest: float = 0.15
    least_apart_deg: float = 0.1


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points of many scans in world axes.

    Attributes:
        xyz: (n, 3) float32 [m].
        scan: (n,) int32 number of the scan.
        range_m: (n,) float32 measured.
        ray: (n, 3) float32 unit directions of the beams, world axes.
        elevation_deg: (n,) float32 of the beams, in the sensor's axes as they were sent.
        intensity: (n,) float32; zeros where there is none.
    """

    xyz: np.ndarray
    scan: np.ndarray
    range_m: np.ndarray
    ray: np.ndarray
    elevation_deg: np.ndarray
    intensity: np.ndarray

    def __len__(self) -> int:
        return len(self.xyz)


@dataclass(frozen=True, eq=False)
class Surfels:
    """The surfaces of a map.

    Attributes:
        key: (m,) int64 numbers of the cells, rising.
        centre: (m, 3) float64 world places [m].
        normal: (m, 3) float64 unit normals, towards the sensor.
        low, high: (m, 3) float64 corners of the box about the points of each.
        reach_m: (m, 8) how far points reach from the centre along `sides` of the normal.
        sd_m: (m,) standard deviation of points across the plane.
        points, scans: (m,) how many lie on it, and how many scans saw it.
        range_m: (m, 2) nearest and farthest look.
        cos_incidence: (m, 2) steepest and flattest look.
        apart_deg: (m,) standard deviation of the elevations at which beams left the sensor.
        reflectance: (m,) mean intensity.
    """

    key: np.ndarray
    centre: np.ndarray
    normal: np.ndarray
    low: np.ndarray
    high: np.ndarray
    reach_m: np.ndarray
    sd_m: np.ndarray
    points: np.ndarray
    scans: np.ndarray
    range_m: np.ndarray
    cos_incidence: np.ndarray
    apart_deg: np.ndarray
    reflectance: np.ndarray

    def __len__(self) -> int:
        return len(self.key)

    def __getitem__(self, rows: np.ndarray) -> Surfels:
        """Some of them, by mask or index array."""
        return Surfels(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def rows_of(self, key: np.ndarray) -> np.ndarray:
        """Row of the surfel in each cell (n,) int64; −1 where there is none."""
        if not len(self):
            return np.full(len(key), -1)
        row = np.minimum(np.searchsorted(self.key, key), len(self) - 1)
        return np.where(self.key[row] == key, row, -1)

    def of_several_lasers(self, settings: SurfelSettings) -> np.ndarray:
        """(m,) bool: which were drawn by beams of several elevations."""
        return self.apart_deg >= settings.least_apart_deg

    def level(self) -> np.ndarray:
        """(m,) bool: which lie flat, as ground does."""
        return np.abs(self.normal[:, 2]) > 0.95


def make_surfels(cloud: Cloud, settings: SurfelSettings, *, steady: bool = False) -> tuple[Surfels, int]:
    """The planes of a cloud, and how many cells with enough points are none.

    Args:
        cloud: points of all scans.
        settings: limits.
        steady: whether normals are those of larger planes, where there are any, see `normals.steadied`.
    """
    key = cell_keys(cloud.xyz, settings.cell_m)
    order = np.argsort(key, kind="stable")
    key = key[order]
    start = np.flatnonzero(np.diff(key, prepend=key[:1] - 1))
    count = np.diff(start, append=len(key))
    enough = count >= settings.least_points
    start, count = start[enough], count[enough]
    rows = order[np.repeat(start - np.concatenate([[0], np.cumsum(count)[:-1]]), count) + np.arange(count.sum())]
    cell = np.repeat(np.arange(len(count)), count)
    kept = np.ones(len(rows), bool)
    for _ in range(2):  # the second time without what lies off the plane
        centre, normal, variance = planes(cloud.xyz[rows[kept]], cell[kept], len(count))
        off = np.einsum("ij,ij->i", cloud.xyz[rows] - centre[cell], normal[cell])
        sd = np.sqrt(np.maximum(variance[:, 0], 1e-8))
        kept = np.abs(off) < 3 * sd[cell]
    good = (np.sqrt(variance[:, 0]) < settings.thickest_m) & (variance[:, 0] < settings.flattest * variance[:, 1])
    rows, cell, off = rows[kept], cell[kept], off[kept]
    if steady:
        points = np.bincount(cell, minlength=len(count))
        normal[good] = steadied(centre[good], normal[good], points[good], sd[good], settings.cell_m)
        off = np.einsum("ij,ij->i", cloud.xyz[rows] - centre[cell], normal[cell])
    surfels = _described(cloud, rows, cell, key[start], centre, normal, off)
    good &= (surfels.scans >= settings.least_scans) & (surfels.points >= settings.least_points)
    return surfels[good], int((~good).sum())


def _described(
    cloud: Cloud,
    rows: np.ndarray,
    cell: np.ndarray,
    keys: np.ndarray,
    centre: np.ndarray,
    normal: np.ndarray,
    off: np.ndarray,
) -> Surfels:
    cells = len(keys)
    count = np.maximum(np.bincount(cell, minlength=cells), 1)
    facing = np.stack([np.bincount(cell, cloud.ray[rows, axis], cells) for axis in range(3)], 1)
    normal = np.where(np.einsum("ij,ij->i", facing, normal)[:, None] > 0, -normal, normal)
    seen = np.unique(cell.astype(np.int64) << 32 | cloud.scan[rows])
    cos = np.abs(np.einsum("ij,ij->i", cloud.ray[rows], normal[cell]))
    start = np.flatnonzero(np.diff(cell, prepend=-1))
    present = cell[start]

    def ends(values: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        low, high = np.zeros((cells, *shape)), np.zeros((cells, *shape))
        low[present], high[present] = np.minimum.reduceat(values, start), np.maximum.reduceat(values, start)
        return low, high

    low, high = ends(cloud.xyz[rows].astype(np.float64), (3,))
    near, far = ends(cloud.range_m[rows].astype(np.float64), ())
    flat, steep = ends(cos, ())
    mean = np.bincount(cell, cloud.elevation_deg[rows], cells) / count
    rest, around = cloud.xyz[rows] - centre[cell], sides(normal)
    reach = [ends(np.einsum("ij,ij->i", rest, around[cell, side]), ())[1] for side in range(around.shape[1])]
    apart = cloud.elevation_deg[rows] - mean[cell]
    return Surfels(
        key=keys,
        centre=centre,
        normal=normal,
        low=low,
        high=high,
        reach_m=np.stack(reach, 1),
        sd_m=np.sqrt(np.bincount(cell, off**2, cells) / count),
        points=np.bincount(cell, minlength=cells),
        scans=np.bincount((seen >> 32).astype(np.int64), minlength=cells),
        range_m=np.stack([near, far], 1),
        cos_incidence=np.stack([steep, flat], 1),
        apart_deg=np.sqrt(np.bincount(cell, apart**2, cells) / count),
        reflectance=np.bincount(cell, cloud.intensity[rows], cells) / count,
    )


def solid_shares(cloud: Cloud, surfels: Surfels, cell_m: float) -> np.ndarray:
    """Share (m,) of the points about each surfel that lie on it: about 1 of a wall, less of a hedge.

    About it are points over its box, within three quarters of a cell of its plane.
    """
    count = len(surfels)
    on, about = np.zeros(count), np.zeros(count)
    main = np.abs(surfels.normal).argmax(1)
    near = np.maximum(_SOLID_SIGMAS * surfels.sd_m, _SOLID_LEAST_M)
    for axis in range(3):
        aside = np.delete(np.arange(3), axis)
        for step in (-1, 0, 1):
            shift = np.zeros(3)
            shift[axis] = step * cell_m
            for start in range(0, len(cloud), _CHUNK):
                xyz = cloud.xyz[start : start + _CHUNK].astype(np.float64)
                row = surfels.rows_of(cell_keys(xyz + shift, cell_m))
                rows = np.flatnonzero((row >= 0) & (main[np.maximum(row, 0)] == axis))
                row, xyz = row[rows], xyz[rows]
                off = np.abs(np.einsum("ij,ij->i", xyz - surfels.centre[row], surfels.normal[row]))
                over = (off < _ABOUT * cell_m) & np.all(
                    (xyz[:, aside] >= surfels.low[row][:, aside]) & (xyz[:, aside] <= surfels.high[row][:, aside]),
                    axis=1,
                )
                about += np.bincount(row[over], minlength=count)
                on += np.bincount(row[over & (off < near[row])], minlength=count)
    return on / np.maximum(about, 1)


def quads(surfels: Surfels) -> tuple[np.ndarray, np.ndarray]:
    """Two triangles a surfel: vertices (4 m, 3) and faces (2 m, 3), in the order of the surfels.

    A quad spans its points' box along the two axes that its normal leans to least, so that neighbours meet.
    """
    count = len(surfels)
    main = np.abs(surfels.normal).argmax(1)
    first, second = (main + 1) % 3, (main + 2) % 3
    every = np.arange(count)
    vertices = np.empty((count, 4, 3))
    for corner, (a_high, b_high) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        a = (surfels.high if a_high else surfels.low)[every, first]
        b = (surfels.high if b_high else surfels.low)[every, second]
        along = surfels.normal[every, first] * (a - surfels.centre[every, first])
        along += surfels.normal[every, second] * (b - surfels.centre[every, second])
        vertices[every, corner, first], vertices[every, corner, second] = a, b
        vertices[every, corner, main] = surfels.centre[every, main] - along / surfels.normal[every, main]
    base = 4 * every[:, None]
    faces = (base + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    return vertices.reshape(-1, 3), faces

"""Heights of road users where lanes lie above each other.

Which lane carries a road user is decided by the lane that the file names, else by the height that it gives, else by the
direction of travel and the height of the step before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from assets.streets import Streets
from cosim.traffic.headings import unit_vectors
from cosim.traffic.trajectories.tracks import RoadTracks

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_STEP_M = 4.0
_BESIDE_M = 4.0  # lanes that may carry a road user
_NEIGHBOURS = 12
_APART_M = 2.0  # heights of different levels
_FEWEST, _MOST = 10, 0.9  # samples on lanes for a verdict on the heights of a file, share that it must fit
_DATUM_M, _SAME_M = 1.5, 1.0  # offset of another vertical datum; heights of one lane
_TURNED_M = 6.0  # cost of a lane across or against the way, as a distance
_CLIMBED = 2.0  # cost of each metre up or down since the step before


@dataclass(frozen=True, eq=False)
class LanePoints:
    """Points along all lanes, a few metres apart.

    Attributes:
        points: (n, 3) [m].
        ways: (n, 2) direction of the lane; NaN away from lanes.
        limits: (n,) speed limit [m/s].
        rows: first and last row of each lane, by id.
        tree: of `points` in the plane.
    """

    points: np.ndarray
    ways: np.ndarray
    limits: np.ndarray
    rows: Mapping[str, tuple[int, int]]
    tree: KDTree

    @classmethod
    def of(cls, streets: Streets) -> LanePoints:
        """Points of a network."""
        from scipy.spatial import KDTree

        dense = [_dense(lane.centre) for lane in streets.lanes]
        ways = [np.gradient(points[:, :2], axis=0) for points in dense]
        for way, lane in zip(ways, streets.lanes, strict=True):
            if lane.use != "drive":
                way[:] = np.nan
        way, points = np.concatenate(ways), np.concatenate(dense)
        counts = [len(each) for each in dense]
        ends = np.cumsum([0, *counts]).tolist()
        limits = np.repeat([lane.speed_mps for lane in streets.lanes], counts)
        rows = {lane.id: (start, end) for lane, start, end in zip(streets.lanes, ends[:-1], ends[1:], strict=True)}
        way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        return cls(points, way, limits, rows, KDTree(points[:, :2]))


def heights_of(tracks: RoadTracks, lanes: LanePoints) -> tuple[np.ndarray, tuple[str, ...]]:
    """Height of each sample (n,) [m]: that of the file, or of the lane that carries the road user.

    Heights of the file are compared with the lanes: those of another vertical datum are shifted, those that were not
    measured are not used. Notes say so.
    """
    z, notes = _checked_heights(tracks, lanes)
    unknown = ~np.isfinite(z)
    if not unknown.any():
        return z, notes
    named = np.array([bool(name) and name in lanes.rows for name in tracks.lanes], bool) & unknown
    for name in {tracks.lanes[row] for row in np.flatnonzero(named).tolist()}:
        rows = np.flatnonzero(named & (np.array(tracks.lanes) == name))
        points = lanes.points[slice(*lanes.rows[name])]
        passes_itself = _passes_itself(points, tracks.front[rows, :2])
        named[rows[passes_itself]] = False
        rows = rows[~passes_itself]
        z[rows] = _height_along(points, tracks.front[rows, :2])
    places = tracks.front[:, :2]
    near, far = lanes.tree.query(places, k=1)[1], np.zeros(len(places), bool)
    low, high = _range_of_heights(lanes, places)
    far = high - low > _APART_M
    plain = unknown & ~named & ~far
    z[plain] = lanes.points[near[plain], 2]
    for user in range(len(tracks.ids)):
        rows = np.arange(*tracks.samples(user).indices(len(z)))
        if (unknown & ~named & far)[rows].any():
            z[rows] = _follow(tracks, rows, z[rows], lanes)
    return z, notes


def _checked_heights(tracks: RoadTracks, lanes: LanePoints) -> tuple[np.ndarray, tuple[str, ...]]:
    """Heights (n,) of the file in the vertical datum of the lanes, NaN where they were not measured; and notes."""
    z = tracks.front[:, 2].copy()
    known = np.flatnonzero(np.isfinite(z))
    if not len(known):
        return z, ()
    positions = tracks.front[known, :2]
    heights = _lane_heights(lanes, positions)
    beside = np.isfinite(heights).any(1)
    if beside.sum() < _FEWEST:
        return z, ()
    known, heights = known[beside], heights[beside]
    lowest, highest = np.nanmin(heights, axis=1), np.nanmax(heights, axis=1)
    if np.ptp(z[known]) == 0 and np.ptp(highest) > _APART_M and np.ptp(lowest) + np.ptp(highest) > 2 * _APART_M:
        value = z[known[0]]
        z[:] = np.nan
        return z, (f"heights are {value:g} m everywhere, although lanes rise and fall: not used",)
    above = z[known, None] - heights
    nearest = np.take_along_axis(above, np.nanargmin(np.abs(above), axis=1)[:, None], axis=1)[:, 0]
    offset = _common_offset(above) if abs(float(np.median(nearest))) > _DATUM_M else 0.0
    if not offset:
        return z, ()
    z -= offset
    return z, (f"heights have another zero than those of the lanes: {offset:.2f} m are subtracted",)


def _common_offset(above: np.ndarray) -> float:
    """The offset [m] that puts most samples on a lane, from their heights above lanes (n, k); 0 if there is none."""
    single = np.nanmax(above, axis=1) - np.nanmin(above, axis=1) < _SAME_M
    if single.sum() < _FEWEST:
        return 0.0
    offset = float(np.median(np.nanmean(above[single], axis=1)))
    return offset if (np.nanmin(np.abs(above - offset), axis=1) < _SAME_M).mean() > _MOST else 0.0


def _passes_itself(points: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """(n,) bool points of a line that passes above itself there, so that the position does not determine the height."""
    from scipy.spatial import KDTree

    near = KDTree(points[:, :2]).query_ball_point(positions, _BESIDE_M)
    return np.array([len(rows) > 1 and np.ptp(points[rows, 2]) > _APART_M for rows in near], bool)


def _lane_heights(lanes: LanePoints, positions: np.ndarray) -> np.ndarray:
    """Heights (n, k) of the points of lanes near each place; NaN where there are fewer."""
    count = min(_NEIGHBOURS, len(lanes.points))
    near = lanes.tree.query(positions, k=count, distance_upper_bound=_BESIDE_M)[1].reshape(len(positions), count)
    return np.append(lanes.points[:, 2], np.nan)[near]


def _range_of_heights(lanes: LanePoints, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest lane (n,) near each place."""
    heights = _lane_heights(lanes, positions)
    none = np.isnan(heights).all(1)
    heights[none] = 0.0
    return np.nanmin(heights, axis=1), np.nanmax(heights, axis=1)


def _follow(tracks: RoadTracks, rows: np.ndarray, known: np.ndarray, lanes: LanePoints) -> np.ndarray:
    """Heights of one road user by the cheapest sequence of lanes (Viterbi's algorithm)."""
    position, heading = tracks.front[rows, :2], tracks.heading_rad[rows]
    count = min(_NEIGHBOURS, len(lanes.points))
    away, near = (each.reshape(len(rows), count) for each in lanes.tree.query(position, k=count))
    height = np.where(np.isfinite(known)[:, None], known[:, None], lanes.points[near, 2])
    ahead = unit_vectors(heading)
    cosine = np.nan_to_num(np.einsum("nkd,nd->nk", lanes.ways[near], ahead))
    cost = away + _TURNED_M * (1 - cosine)
    total, back = cost[0], np.zeros((len(rows), count), int)
    for step in range(1, len(rows)):
        change = total[:, None] + _CLIMBED * np.abs(height[step][None] - height[step - 1][:, None])
        back[step] = change.argmin(0)
        total = change.min(0) + cost[step]
    chosen = np.zeros(len(rows), int)
    chosen[-1] = int(total.argmin())
    for step in range(len(rows) - 1, 0, -1):
        chosen[step - 1] = back[step, chosen[step]]
    return height[np.arange(len(rows)), chosen]


def _height_along(points: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Height of a line at the points next to places, interpolated."""
    start, way = points[:-1], np.diff(points, axis=0)
    length = np.maximum((way[:, :2] ** 2).sum(1), 1e-12)
    share = np.einsum("nkd,kd->nk", positions[:, None] - start[None, :, :2], way[:, :2]) / length
    share = np.clip(share, 0, 1)
    foot = start[None] + share[..., None] * way[None]
    nearest = ((foot[..., :2] - positions[:, None]) ** 2).sum(-1).argmin(1)
    return foot[np.arange(len(positions)), nearest, 2]


def _dense(centre: np.ndarray) -> np.ndarray:
    """Points (n, 3) along a line, a few metres apart."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centre[:, :2], axis=0), axis=1))])
    at = np.linspace(0, along[-1], max(2, int(along[-1] / _STEP_M) + 1))
    return np.column_stack([np.interp(at, along, centre[:, axis]) for axis in range(3)])

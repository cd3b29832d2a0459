"""Trajectories compared with the streets that they belong to: places, directions, speeds, heights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from assets.streets import Streets
from cosim.traffic.trajectories.levels import LanePoints, heights_of
from cosim.traffic.trajectories.table_options import AXES
from cosim.traffic.trajectories.tracks import RoadTracks, TrajectoryError

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_BESIDE_M, _FEWEST_SHARE = 30.0, 0.5
_MOVED_M, _NEXT_S, _FEWEST_WAYS = 0.1, 1.5, 10
_FEWEST_USERS = 2  # a single way may lie along a lane by chance
_ON_LANE_M, _ALONG = 2.5, 0.7
_CONTRADICTS, _UNRELATED, _CONFIRMS = 0.5, 0.3, 0.6
_TOO_FAST = 2.0
_UNITS_M, _WIDE_M = (0.3048, 0.01, 0.001), 20.0  # other units of positions; extent of tracks needed to identify one


def check_streets(path: Path, tracks: RoadTracks, streets: Streets) -> RoadTracks:
    """Tracks with the heights of the lanes that they are on.

    Raises:
        TrajectoryError: most places lie off the streets, vehicles drive against the lanes, or twice as fast as allowed.
    """
    lanes = LanePoints.of(streets)
    points, ways, tree = lanes.points, lanes.ways, lanes.tree
    tracks = _in_local_axes(tracks, streets, tree)
    away, nearest = tree.query(tracks.front[:, :2])
    if (away < _BESIDE_M).mean() < _FEWEST_SHARE:
        remedy = _fitting_unit(tracks, tree) or _fitting_axes(tracks, tree, ways)
        middle, town = np.median(tracks.front[:, :2], axis=0), np.median(points[:, :2], axis=0)
        raise TrajectoryError(
            f"{path}: most places lie off the streets of {streets.name} (median {np.median(away):.0f} m away; tracks "
            f"about ({middle[0]:.0f}, {middle[1]:.0f}) m, streets about ({town[0]:.0f}, {town[1]:.0f}) m); give the "
            f"network they were recorded in, in the same axes{remedy}"
        )
    if tracks.inferred:  # a table; the axes of other formats are defined
        _check_directions(path, tracks, streets, tree, ways)
        _check_speeds(path, tracks, lanes.limits[nearest], away)
    front = tracks.front.copy()
    front[:, 2], notes = heights_of(tracks, lanes)
    return replace(tracks, front=front, notes=(*tracks.notes, *(f"{path}: {note}" for note in notes)))


def _in_local_axes(tracks: RoadTracks, streets: Streets, tree: KDTree) -> RoadTracks:
    """Tracks about the local origin, whether the file has the coordinates of the network's files or local ones."""
    offset = np.array(streets.origin_m)
    if not offset.any():
        return tracks
    moved = tracks.front - offset
    away = [np.median(tree.query(front[:, :2])[0]) for front in (tracks.front, moved)]
    return replace(tracks, front=moved) if away[1] < away[0] else tracks


def _check_speeds(path: Path, tracks: RoadTracks, limit_mps: np.ndarray, away_m: np.ndarray) -> None:
    """Raise where half of the vehicles are far faster than the lanes allow: then a unit is wrong."""
    ratios = []
    for user, kind in enumerate(tracks.kinds):
        rows = tracks.samples(user)
        near = (away_m[rows] < _BESIDE_M) & (limit_mps[rows] > 1)
        if kind not in ("pedestrian", "cyclist") and near.any() and not tracks.stands(user):
            ratios.append(float(np.quantile(tracks.speed_mps[rows][near] / limit_mps[rows][near], 0.9)))
    if ratios and np.median(ratios) > _TOO_FAST:
        raise TrajectoryError(
            f"{path}: half of the vehicles drive {np.median(ratios):.2g} times as fast as the lanes allow: the unit of "
            f"time or of positions is another; state it in {path}.yaml, as `metres: 0.3048` or `time_unit_s: 0.2`, or "
            "give a network with the speed limits of the place"
        )


def _driven(tracks: RoadTracks) -> tuple[np.ndarray, np.ndarray]:
    """Middle (m, 2) and direction (m, 2) of the ways of vehicles between samples that are far enough apart."""
    user = np.repeat(np.arange(len(tracks.ids)), np.diff(tracks.first))
    drives = np.array([kind not in ("pedestrian", "cyclist") for kind in tracks.kinds], bool)
    move = np.diff(tracks.front[:, :2], axis=0)
    way = np.linalg.norm(move, axis=1)
    far = (np.diff(user) == 0) & drives[user[:-1]] & (way > _MOVED_M) & (np.diff(tracks.time_s) < _NEXT_S)
    middle = (tracks.front[1:, :2] + tracks.front[:-1, :2]) / 2
    return middle[far], move[far] / way[far, None]


def _agreement(positions: np.ndarray, moves: np.ndarray, tree: KDTree, ways: np.ndarray) -> float:
    """Share of ways along the nearest lane less the share of ways against it."""
    if not len(positions):
        return 0.0
    nearest = tree.query(positions, distance_upper_bound=_ON_LANE_M)[1]
    padded = np.concatenate([ways, np.full((1, 2), np.nan)])
    cosine = np.nan_to_num(np.einsum("nd,nd->n", padded[nearest], moves))
    return float((cosine > _ALONG).mean() - (cosine < -_ALONG).mean())


def _check_directions(path: Path, tracks: RoadTracks, streets: Streets, tree: KDTree, ways: np.ndarray) -> None:
    """Raise where vehicles drive against the lanes that they are on, and other axes would have them drive along."""
    places, moves = _driven(tracks)
    if len(places) < _FEWEST_WAYS:
        return
    found, other = _agreement(places, moves, tree, ways), _fitting_axes(tracks, tree, ways)
    if found > -_CONTRADICTS and (found > _UNRELATED or not other or len(tracks.ids) < _FEWEST_USERS):
        return
    raise TrajectoryError(
        f"{path}: vehicles do not drive along the lanes of {streets.name} (share of ways along a lane less share "
        f"against: {found:.2f}){other}; give the network they were recorded in, or state "
        f"the axes in {path}.yaml, as `axes: x,-y`"
    )


def _fitting_unit(tracks: RoadTracks, tree: KDTree) -> str:
    """A phrase that names the unit of positions with which tracks of a table would lie on lanes; empty without one."""
    if not tracks.inferred or tracks.inferred.get("metres") != 1.0:
        return ""
    for metres in _UNITS_M:
        away = tree.query(tracks.front[:, :2] * metres)[0]
        if (away < _ON_LANE_M).mean() > _FEWEST_SHARE and np.ptp(tracks.front[:, :2], axis=0).max() * metres > _WIDE_M:
            return f"; with `metres: {metres:g}` they would lie on its lanes"
    return ""


def _fitting_axes(tracks: RoadTracks, tree: KDTree, ways: np.ndarray) -> str:
    """A phrase that names the axes with which vehicles would drive along the lanes; empty where none do."""
    places, moves = _driven(tracks)
    if len(places) < _FEWEST_WAYS:
        return ""
    scores = {}
    for axes in AXES[1:]:
        signs = [(-1.0 if axis.startswith("-") else 1.0, "xy".index(axis.strip("-"))) for axis in axes.split(",")]
        turned = [np.column_stack([sign * values[:, at] for sign, at in signs]) for values in (places, moves)]
        scores[axes] = _agreement(turned[0], turned[1], tree, ways)
    best = max(scores, key=lambda axes: scores[axes])
    return f"; with `axes: {best}` they would drive along them" if scores[best] > _CONFIRMS else ""

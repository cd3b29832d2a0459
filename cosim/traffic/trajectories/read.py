"""Trajectories from files: SUMO's FCD output, CommonRoad, OpenSCENARIO, and tables of many names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from assets.streets import Streets
from cosim.traffic.trajectories.commonroad import read_commonroad
from cosim.traffic.trajectories.fcd import read_fcd
from cosim.traffic.trajectories.openscenario import read_openscenario
from cosim.traffic.trajectories.table import read_table
from cosim.traffic.trajectories.tracks import RoadTracks, TrajectoryError
from sumo_nets.xml_guard import read_xml

_BESIDE_M, _FEWEST_SHARE = 30.0, 0.5


def read_trajectories(path: Path, streets: Streets, type_files: Iterable[Path] = ()) -> RoadTracks:
    """Trajectories of a file, on the streets they belong to.

    Args:
        path: XML of SUMO's `--fcd-output`, of CommonRoad or of OpenSCENARIO, plain or gzipped; else a table, CSV.
        streets: give heights where the file has none.
        type_files: SUMO's files with the vTypes that FCD output names.

    Raises:
        TrajectoryError: the file cannot be read, holds no road user, somebody jumps, or most are not on the streets.
        TownError: it is no safe, whole XML.
    """
    if not path.is_file():
        raise TrajectoryError(
            f"trajectories {path}: no such file; give FCD output, CommonRoad, OpenSCENARIO or a table (CSV)"
        )
    left_out: Counter[str] = Counter()
    if path.name.removesuffix(".gz").endswith((".xml", ".xosc")):
        root = read_xml(path, "fcd-export", "commonRoad", "OpenSCENARIO")
        if root.tag == "fcd-export":
            tracks = read_fcd(path, root, type_files, left_out)
        elif root.tag == "OpenSCENARIO":
            tracks = read_openscenario(path, root, left_out)
        else:
            tracks = read_commonroad(path, root, left_out)
    else:
        tracks = read_table(path, type_files, left_out)
    if left_out:
        said = ", ".join(f"{count} of {name!r}" for name, count in sorted(left_out.items()))
        tracks = replace(tracks, notes=(f"{path}: left out, as they are no road users: {said}",))
    return _on_streets(path, tracks, streets)


def _on_streets(path: Path, tracks: RoadTracks, streets: Streets) -> RoadTracks:
    """Tracks with heights; refuses those that lie elsewhere."""
    points = np.concatenate([_dense(lane.centre) for lane in streets.lanes])
    away, nearest = KDTree(points[:, :2]).query(tracks.front[:, :2])
    if (away < _BESIDE_M).mean() < _FEWEST_SHARE:
        middle, town = np.median(tracks.front[:, :2], axis=0), np.median(points[:, :2], axis=0)
        raise TrajectoryError(
            f"{path}: most places lie off the streets of {streets.name} (median {np.median(away):.0f} m away; tracks "
            f"about ({middle[0]:.0f}, {middle[1]:.0f}) m, streets about ({town[0]:.0f}, {town[1]:.0f}) m); give the "
            "network they were recorded in, in the same axes"
        )
    tracks.front[:, 2] = np.where(np.isfinite(tracks.front[:, 2]), tracks.front[:, 2], points[nearest, 2])
    return tracks


def _dense(centre: np.ndarray, step_m: float = 4.0) -> np.ndarray:
    """Points (n, 3) along a line, a few metres apart."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centre[:, :2], axis=0), axis=1))])
    at = np.linspace(0, along[-1], max(2, int(along[-1] / step_m) + 1))
    return np.column_stack([np.interp(at, along, centre[:, axis]) for axis in range(3)])

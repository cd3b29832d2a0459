"""Measured trajectories from files of any known format.

Tables of this loop are read here; FCD output, CommonRoad, OpenSCENARIO and the tables of data sets by
`cosim.traffic.trajectories`, which infers units, clocks and axes; some data sets with files of their own by `datasets`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.driver_discrepancy.datasets import read_dataset
from cosim.driver_discrepancy.tracks import COLUMNS, TrackError, Tracks, gathered, read_tracks
from cosim.traffic.trajectories.read import read_trajectories
from cosim.traffic.trajectories.table import is_columnar
from cosim.traffic.trajectories.tracks import RoadTracks, TrajectoryError
from sumo_nets import Town

_LOOP = frozenset(COLUMNS) - {"lane", "type"}


def read_measured(path: Path, town: Town, vtypes: Sequence[Path] = ()) -> Tracks:
    """Read trajectories.

    Args:
        path: a table (CSV, Parquet, Feather), FCD output, CommonRoad or OpenSCENARIO.
        town: gives the streets.
        vtypes: SUMO files with further vehicle types.

    Raises:
        TrackError: the file cannot be read, has no moving vehicle, or fewer than two vehicles.
    """
    if path.name.removesuffix(".gz").endswith((".xml", ".xosc")) or is_columnar(path):
        return _from_road_tracks(path, _read(path, town, vtypes))
    header = _header(path)
    if not header or set(header) >= _LOOP or len(_LOOP & set(header)) >= 4:
        return _in_local_axes(read_tracks(path), town)
    tracks = read_dataset(path, header, town)
    return _from_road_tracks(path, _read(path, town, vtypes)) if tracks is None else _in_local_axes(tracks, town)


def _read(path: Path, town: Town, vtypes: Sequence[Path]) -> RoadTracks:
    try:
        return read_trajectories(path, town.streets, (*town.type_files, *vtypes))
    except TrajectoryError as error:
        raise TrackError(str(error)) from error


def _in_local_axes(tracks: Tracks, town: Town) -> Tracks:
    """Tracks about the town's local origin, whether the file has local coordinates or those of the network."""
    offset = np.array(town.streets.origin_m)[:2]
    if not offset.any() or not len(tracks):
        return tracks
    middle = np.median(np.concatenate([lane.centre[:, :2] for lane in town.streets.lanes]), axis=0)
    here = np.median(tracks.place, axis=0)
    is_far = np.linalg.norm(here - offset - middle) < np.linalg.norm(here - middle)
    return replace(tracks, place=tracks.place - offset) if is_far else tracks


def _from_road_tracks(path: Path, road: RoadTracks) -> Tracks:
    driving = [kind not in ("pedestrian", "tram") for kind in road.kinds]
    if not any(driving):
        raise TrackError(f"{path}: holds people on foot only; give trajectories of vehicles")
    counts = np.diff(road.first)
    user = np.repeat(np.arange(len(road.ids)), counts)
    keep = np.array(driving, bool)[user]
    types = [
        word.partition("@")[0] if road.sumo_clock else kind for word, kind in zip(road.types, road.kinds, strict=True)
    ]
    tracks = gathered(
        [road.ids[at] for at in user[keep].tolist()],
        [types[at] for at in user[keep].tolist()],
        [name for name, kept in zip(road.lanes, keep.tolist(), strict=True) if kept],
        road.time_s[keep],
        road.front[keep, :2],
        road.speed_mps[keep],
        np.angle(np.exp(1j * road.heading_rad[keep])),
    )
    if len(tracks.ids) < 2:
        raise TrackError(f"{path}: holds one vehicle only ({', '.join(tracks.ids)!r}); give two or more")
    return replace(tracks, notes=tuple(road.notes), derives_speed=road.derives_speed)


def _header(path: Path) -> list[str]:
    try:
        with path.open(encoding="utf-8-sig") as file:
            line = file.readline()
    except (OSError, UnicodeDecodeError):
        return []
    separator = ";" if line.count(";") > line.count(",") else ","
    return [name.strip() for name in line.strip().split(separator)]

"""Tables of data sets with a layout of their own.

highD, inD, rounD, exiD: `NN_tracks.csv` with `NN_tracksMeta.csv` and `NN_recordingMeta.csv` (Krajewski et al., ITSC
2018; Bock et al., IV 2020). NGSIM: columns of the FHWA tables, in feet and milliseconds. pNEUMA: a vehicle per line
(Barmpounakis and Geroliminis, Transp. Res. C 2020), positions of the middle of the body. SUMO: `--fcd-output FILE.csv`.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.driver_discrepancy.fcd import read_fcd_table
from cosim.driver_discrepancy.tracks import TrackError, Tracks, gathered
from cosim.traffic.starting import start_sumo_with
from cosim.traffic.trajectories.kinds import user_of
from sumo_nets import Town

_FOOT_M = 0.3048
_CENTRED = ("xcenter", "ycenter", "heading", "length")
_CORNERS = ("x", "y", "width", "height")
_KINDS = {
    "car": "car",
    "taxi": "car",
    "van": "van",
    "medium vehicle": "van",
    "truck": "truck",
    "heavy vehicle": "truck",
    "truck_bus": "truck",
    "trailer": "truck",
    "bus": "bus",
    "motorcycle": "motorcycle",
    "1": "motorcycle",
    "2": "car",
    "3": "truck",
}


def read_dataset(path: Path, header: Sequence[str], town: Town) -> Tracks | None:
    """Read a table by its columns; None for a layout that is none of these.

    Raises:
        TrackError: a value is no number, or a file that belongs to it is missing.
    """
    names = {name.lower(): name for name in header}
    if "timestep_time" in names and "vehicle_id" in names:
        return _without_bodies(read_fcd_table(path))
    if "trackid" in names and "xcenter" in names:
        return _read_levelx(path, header, centred=True)
    if {"frame", "id", "x", "y", "xvelocity"} <= names.keys():
        return _read_levelx(path, header, centred=False)
    if {"vehicle_id", "global_x", "global_y"} <= names.keys() or {"vehicle_id", "local_x", "local_y"} <= names.keys():
        return _read_ngsim(path, names)
    if names.keys() >= {"track_id", "type", "traveled_d"}:
        return _read_pneuma(path, town)
    return None


def _without_bodies(tracks: Tracks) -> Tracks:
    return replace(tracks, types=tuple(word.partition("@")[0] for word in tracks.types))


def _columns(path: Path, separator: str = ",") -> dict[str, list[str]]:
    with path.open(encoding="utf-8-sig", newline="") as file:
        rows = [row for row in csv.reader(file, delimiter=separator) if row]
    width = len(rows[0])
    bad = next((number for number, row in enumerate(rows, 1) if len(row) != width), None)
    if bad is not None:
        raise TrackError(f"{path}: line {bad} has {len(rows[bad - 1])} values, the header {width}")
    return {name.strip().lower(): [row[at] for row in rows[1:]] for at, name in enumerate(rows[0])}


def _numbers(path: Path, name: str, texts: list[str]) -> np.ndarray:
    try:
        return np.array(texts, dtype=float)
    except ValueError:
        raise TrackError(f"{path}: column {name} holds a value that is no number") from None


def _companion(path: Path, word: str) -> dict[str, list[str]]:
    other = path.with_name(path.name.replace("_tracks", f"_{word}"))
    if other == path or not other.is_file():
        raise TrackError(f"{path}: needs {path.name.replace('_tracks', f'_{word}')} in the same folder; copy it there")
    return _columns(other)


def _read_levelx(path: Path, header: Sequence[str], *, centred: bool) -> Tracks:
    """highD (corners of boxes, y downwards) and inD, rounD, exiD (centres)."""
    table, meta, recording = _columns(path), _companion(path, "tracksMeta"), _companion(path, "recordingMeta")
    rate = float(recording["framerate"][0])
    key = "trackid" if centred else "id"
    kind = {who: _KINDS.get(word.lower(), "") for who, word in zip(meta[key], meta["class"], strict=True)}
    wanted = ("frame", "xvelocity", "yvelocity", *(_CENTRED if centred else _CORNERS))
    missing = [name for name in wanted if name not in table]
    if missing:
        raise TrackError(f"{path}: missing columns {', '.join(missing)}; give the file as it was published")
    number = {name: _numbers(path, name, table[name]) for name in wanted}
    vx, vy = number["xvelocity"], number["yvelocity"]
    if centred:
        position = np.column_stack([number["xcenter"], number["ycenter"]])
        heading, length = np.radians(number["heading"]), number["length"]
    else:
        position = np.column_stack([number["x"] + number["width"] / 2, -(number["y"] + number["height"] / 2)])
        vy, length = -vy, number["width"]
        heading = np.arctan2(vy, vx)
    position = position + np.column_stack([np.cos(heading), np.sin(heading)]) * length[:, None] / 2
    return _gather(path, table[key], kind, number["frame"] / rate, position, np.hypot(vx, vy), heading)


def _read_ngsim(path: Path, names: dict[str, str]) -> Tracks:
    """Positions in feet, frames of 0.1 s; local axes are x to the right and y along the road."""
    table = _columns(path)
    axes = ("global_x", "global_y") if "global_x" in names else ("local_x", "local_y")
    position = np.column_stack([_numbers(path, axis, table[axis]) for axis in axes]) * _FOOT_M
    speed = _numbers(path, "v_vel", table["v_vel"]) * _FOOT_M
    if "global_time" in names:
        time_s = _numbers(path, "global_time", table["global_time"]) / 1000
        time_s = time_s - np.floor(time_s.min())
    else:
        time_s = _numbers(path, "frame_id", table["frame_id"]) / 10
    classes = table.get("v_class", ["2"] * len(speed))
    kind = {who: _KINDS.get(word.strip(), "car") for who, word in zip(table["vehicle_id"], classes, strict=True)}
    return _gather(path, table["vehicle_id"], kind, time_s, position, speed, None)


def _read_pneuma(path: Path, town: Town) -> Tracks:
    """A line per vehicle: id, type, two means, then latitude, longitude, speed in km/h, two accelerations, time."""
    ids: list[str] = []
    kind: dict[str, str] = {}
    values: list[np.ndarray] = []
    with path.open(encoding="utf-8-sig") as file:
        next(file)
        for number, line in enumerate(file, 2):
            cells = [cell.strip() for cell in line.strip().rstrip(";").split(";")]
            if len(cells) < 10:
                continue
            try:
                rows = np.array(cells[4 : 4 + (len(cells) - 4) // 6 * 6], dtype=float).reshape(-1, 6)
            except ValueError:
                raise TrackError(f"{path}: line {number} holds a value that is no number") from None
            kind[cells[0]] = _KINDS.get(cells[1].lower(), "")
            ids += [cells[0]] * len(rows)
            values.append(rows)
    if not values:
        raise TrackError(f"{path}: holds no vehicle; give pNEUMA's file with a vehicle per line")
    table = np.concatenate(values)
    position = _from_geographic(path, town, table[:, 1], table[:, 0])
    tracks = _gather(path, ids, kind, table[:, 5], position, table[:, 2] / 3.6, None)
    length = [user.size_m[0] if (user := user_of(word)) else 0.0 for word in tracks.types]
    ahead = np.column_stack([np.cos(tracks.heading_rad), np.sin(tracks.heading_rad)])
    return replace(tracks, place=tracks.place + np.nan_to_num(ahead) * np.array(length)[tracks.vehicle][:, None] / 2)


def _from_geographic(path: Path, town: Town, lon_deg: np.ndarray, lat_deg: np.ndarray) -> np.ndarray:
    """Positions (n, 2) in the network's axes [m], by SUMO's own projection of the network."""
    if not town.network.hasGeoProj():
        raise TrackError(
            f"{path}: has latitudes and longitudes, and the network of {town.name} no geographic projection; give a "
            "network that was imported with one"
        )
    sumo = start_sumo_with(["-n", str(town.net)])
    try:
        pairs = zip(lon_deg.tolist(), lat_deg.tolist(), strict=True)
        return np.array([sumo.simulation.convertGeo(lon, lat, fromGeo=True) for lon, lat in pairs], float)
    finally:
        sumo.close()


def _gather(
    path: Path,
    ids: Sequence[str],
    kind: dict[str, str],
    time_s: np.ndarray,
    position: np.ndarray,
    speed: np.ndarray,
    heading: np.ndarray | None,
) -> Tracks:
    keep = np.array([bool(kind[who]) for who in ids], bool)
    if not keep.any():
        raise TrackError(f"{path}: holds no vehicle that drives; give trajectories of vehicles")
    names = np.array(ids, dtype=str)[keep]
    tracks = gathered(
        names.tolist(),
        [kind[who] for who in names.tolist()],
        [""] * len(names),
        time_s[keep],
        position[keep],
        np.abs(speed[keep]),
        np.zeros(len(names)) if heading is None else np.angle(np.exp(1j * heading[keep])),
    )
    if len(tracks.ids) < 2:
        raise TrackError(f"{path}: holds one vehicle only ({', '.join(tracks.ids)!r}); give two or more")
    others = len({who for who in ids if not kind[who]})
    if others:
        tracks = replace(tracks, notes=(f"{others} road users that are no motor vehicles were left out",))
    return tracks if heading is not None else replace(tracks, heading_rad=_courses(tracks))


def _courses(tracks: Tracks) -> np.ndarray:
    """Direction of the way about each sample; the previous one at rest, NaN for a vehicle that never moves."""
    found = np.full(len(tracks), np.nan)
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids) + 1))
    for start, end in zip(first[:-1].tolist(), first[1:].tolist(), strict=True):
        position = tracks.place[start:end]
        lag = max(1, round(0.5 / max(tracks.step_s, 1e-3)))
        after = position[np.minimum(np.arange(len(position)) + lag, len(position) - 1)]
        before = position[np.maximum(np.arange(len(position)) - lag, 0)]
        move = after - before
        course = np.where(np.hypot(*move.T) > 0.3, np.arctan2(move[:, 1], move[:, 0]), np.nan)
        known = np.flatnonzero(np.isfinite(course))
        if len(known):
            course = course[known[np.clip(np.searchsorted(known, np.arange(len(course)), "right") - 1, 0, None)]]
        found[start:end] = course
    return found

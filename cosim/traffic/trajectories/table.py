"""Tracks in a table (CSV): the traffic loop's, and those of data sets, whose columns have many names.

Argoverse 1 and 2 (Chang et al., CVPR 2019; Wilson et al., NeurIPS 2021), Waymo Open Motion (Ettinger et al., ICCV 2021)
and INTERACTION (Zhan et al., 2019) name the middle of the body; the traffic loop's table the front bumper.
"""

from __future__ import annotations

import csv
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.traffic.trajectories.kinds import sumo_types, user_of
from cosim.traffic.trajectories.tracks import RoadTracks, Sample, TrajectoryError, User, gather

# Names of a column, and by how much its numbers are multiplied to be SI.
_NAMES: dict[str, dict[str, float]] = {
    "time": {"time_s": 1, "timestamp": 1, "t": 1, "time": 1, "timestamp_s": 1, "timestamp_ms": 1e-3}
    | {"timestamp_ns": 1e-9, "timestamp_us": 1e-6, "timestep": 0.1, "frame_id": 0.1},
    "id": {"id": 1, "track_id": 1, "vehicle_id": 1, "object_id": 1},
    "x": {"x_m": 1, "x": 1, "position_x": 1, "center_x": 1, "tx_m": 1},
    "y": {"y_m": 1, "y": 1, "position_y": 1, "center_y": 1, "ty_m": 1},
    "heading": {"heading_deg": math.pi / 180, "heading": 1, "heading_rad": 1, "yaw": 1, "psi_rad": 1, "yaw_rad": 1},
    "speed": {"speed_mps": 1, "speed": 1},
    "vx": {"velocity_x": 1, "vx": 1, "vx_mps": 1},
    "vy": {"velocity_y": 1, "vy": 1, "vy_mps": 1},
    "length": {"length": 1, "length_m": 1},
    "width": {"width": 1, "width_m": 1},
    "height": {"height": 1, "height_m": 1},
    "type": {"type": 1, "object_type": 1, "agent_type": 1, "class": 1, "category": 1},
    "lane": {"lane": 1},
    "valid": {"valid": 1, "observed_valid": 1},
}
_NEEDED = ("time", "id", "x", "y")
_LOOP = {"time_s", "id", "x_m", "y_m", "speed_mps", "heading_deg", "lane", "type"}
_MOVED_M = 0.1
_FALSE = frozenset({"0", "false", ""})


def read_table(path: Path, type_files: Iterable[Path], left_out: Counter[str]) -> RoadTracks:
    """Tracks of a CSV file; whose word for a road user is not known is counted in `left_out`.

    Raises:
        TrajectoryError: columns are missing, a value is no number, or see `gather`.
        TownError: a file of types cannot be read.
    """
    header, rows = _rows(path)
    of_loop, known = set(header) >= _LOOP, sumo_types(type_files)
    columns = _columns(path, header)
    samples: list[Sample] = []
    users: dict[str, User] = {}
    strangers: dict[str, str] = {}
    for number, row in enumerate(rows, 2):
        if len(row) < len(header):
            raise TrajectoryError(f"{path}: line {number} has {len(row)} values, the header {len(header)}")
        cells = _Cells(path, number, row, columns)
        if cells.text("valid", "1").lower() in _FALSE:
            continue
        name = cells.text("id", "").removesuffix(".0")
        if name not in users and name not in strangers:
            word = cells.text("type", "car").removesuffix(".0")
            sizes = (cells.size("length"), cells.size("width"), cells.size("height"))
            user = known.get(word) or user_of(word, sizes)
            if user is None:
                strangers[name] = word
            else:
                users[name] = user
        if name in users:
            samples.append(cells.sample(name))
    left_out.update(strangers.values())
    tracks = gather(path, samples, users, centred=not of_loop)
    return _with_true_headings(tracks) if of_loop else tracks


def _with_true_headings(tracks: RoadTracks) -> RoadTracks:
    """The same with headings taken for SUMO's (clockwise from north) where the ways driven say so."""
    move = np.diff(tracks.front[:, :2], axis=0)
    apart = np.hypot(move[:, 0], move[:, 1])
    same = np.ones(len(move), bool)
    same[tracks.first[1:-1] - 1] = False
    moved = same & (apart > _MOVED_M)
    course, heading = np.arctan2(move[:, 1], move[:, 0])[moved], tracks.heading_rad[:-1][moved]
    if np.cos(course - (np.pi / 2 - heading)).sum() <= np.cos(course - heading).sum():
        return tracks
    return replace(tracks, heading_rad=np.pi / 2 - tracks.heading_rad)


class _Cells:
    """One line of a table, its cells asked for by what they mean."""

    def __init__(self, path: Path, number: int, row: Sequence[str], columns: dict[str, tuple[int, float, str]]) -> None:
        self._path, self._number, self._row, self._columns = path, number, row, columns

    def text(self, what: str, default: str) -> str:
        """The cell's text, or the default where there is no such column."""
        return self._row[self._columns[what][0]].strip() if what in self._columns else default

    def value(self, what: str) -> float:
        """The cell's number in SI units; NaN where there is no such column."""
        if what not in self._columns:
            return math.nan
        at, factor, name = self._columns[what]
        try:
            return float(self._row[at]) * factor
        except ValueError:
            raise TrajectoryError(
                f"{self._path}: {name} is {self._row[at]!r} in line {self._number}; write a number"
            ) from None

    def size(self, what: str) -> float | None:
        """A length, or None where it is not told."""
        value = self.value(what)
        return value if value > 0 else None

    def sample(self, user: str) -> Sample:
        """The line as a sample."""
        speed = self.value("speed")
        if math.isnan(speed):
            speed = math.hypot(self.value("vx"), self.value("vy"))
        return Sample(
            time_s=self.value("time"),
            user=user,
            x_m=self.value("x"),
            y_m=self.value("y"),
            heading_rad=self.value("heading"),
            speed_mps=abs(speed),
            lane=self.text("lane", ""),
        )


def _columns(path: Path, header: Sequence[str]) -> dict[str, tuple[int, float, str]]:
    """Where each meaning stands in a line, its factor and its name."""
    found = {}
    for what, names in _NAMES.items():
        for at, name in enumerate(header):
            if name.lower() in names:
                found[what] = at, names[name.lower()], name
                break
    missing = [what for what in _NEEDED if what not in found]
    if missing:
        names = "; ".join(f"{what}: {', '.join(_NAMES[what])}" for what in missing)
        raise TrajectoryError(f"{path}: lacks columns, which may be called {names}; its header is {','.join(header)}")
    return found


def _rows(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise TrajectoryError(f"{path} is no table: {' '.join(str(error).split())}; give CSV with a header") from error
    if not lines:
        raise TrajectoryError(f"{path} is empty; give CSV with a header")
    return [name.strip() for name in lines[0]], lines[1:]

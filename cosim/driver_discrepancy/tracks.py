"""Trajectories of vehicles, as a CSV file holds them."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim.drives.writer import explained
from cosim.errors import CosimError

COLUMNS = ("time_s", "id", "x_m", "y_m", "speed_mps", "heading_deg", "lane", "type")
_OPTIONAL = ("lane", "type")
_ON_FOOT = ("pedestrian", "person", "type_pedestrian")
_NUMBERS = ("time_s", "x_m", "y_m", "speed_mps", "heading_deg")


class TrackError(CosimError):
    """Trajectories that cannot be used."""


@dataclass(frozen=True, eq=False)
class Tracks:
    """Trajectories, sorted by vehicle and time.

    Attributes:
        ids: of the v vehicles, sorted.
        types: of each: a vType of the town, or a kind (`car`, `van`, …).
        vehicle: (n,) int row of `ids` of each sample.
        time_s: (n,) float64.
        place: (n, 2) middle of the front bumper, world metres.
        speed_mps: (n,).
        heading_rad: (n,) counter-clockwise from east.
        lane: n SUMO lane ids; empty where unknown.
        notes: what was changed when they were read, a sentence each.
        derives_speed: speeds were not measured but derived from positions.
    """

    ids: tuple[str, ...]
    types: tuple[str, ...]
    vehicle: np.ndarray
    time_s: np.ndarray
    place: np.ndarray
    speed_mps: np.ndarray
    heading_rad: np.ndarray
    lane: np.ndarray
    notes: tuple[str, ...] = ()
    derives_speed: bool = False

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def start_s(self) -> float:
        """Start time of the recording."""
        return float(self.time_s.min())

    @property
    def seconds(self) -> float:
        """Duration [s]."""
        return float(np.ptp(self.time_s))

    @cached_property
    def step_s(self) -> float:
        """Usual time between two samples of a vehicle, the shortest that is common."""
        gaps = np.diff(self.time_s)[np.diff(self.vehicle) == 0]
        return float(np.quantile(gaps, 0.2)) if len(gaps) else 0.0


def gathered(
    ids: Sequence[str] | np.ndarray,
    types: Sequence[str] | np.ndarray,
    lane: Sequence[str] | np.ndarray,
    time_s: np.ndarray,
    position: np.ndarray,
    speed_mps: np.ndarray,
    heading_rad: np.ndarray,
) -> Tracks:
    """Trajectories from samples in any order."""
    names, first, vehicle = np.unique(np.array(ids, dtype=str), return_index=True, return_inverse=True)
    order = np.lexsort((time_s, vehicle))
    return Tracks(
        ids=tuple(names.tolist()),
        types=tuple(str(types[int(i)]) for i in first),
        vehicle=vehicle[order],
        time_s=time_s[order],
        place=position[order],
        speed_mps=speed_mps[order],
        heading_rad=heading_rad[order],
        lane=np.array(lane, dtype=str)[order],
    )


def take_rows(tracks: Tracks, chosen: np.ndarray) -> Tracks:
    """Samples of a mask or of row numbers, of the same vehicles; those without samples must not be left."""
    parts = ("vehicle", "time_s", "place", "speed_mps", "heading_rad", "lane")
    return replace(tracks, **{name: getattr(tracks, name)[chosen] for name in parts})


def without_empty(tracks: Tracks) -> Tracks:
    """The same without vehicles that have no sample."""
    there = np.unique(tracks.vehicle)
    if len(there) == len(tracks.ids):
        return tracks
    ids, types = (tuple(words[at] for at in there.tolist()) for words in (tracks.ids, tracks.types))
    return replace(tracks, ids=ids, types=types, vehicle=np.searchsorted(there, tracks.vehicle))


def read_tracks(path: Path) -> Tracks:
    """Trajectories from a CSV file with the columns `COLUMNS`; headings may be counted as SUMO does, or from east.

    Rows may be in any order; `lane` and `type` may be missing.

    Raises:
        TrackError: columns are missing, a value is not a finite number, or there are fewer than two
            vehicles.
    """
    header, rows = _rows(path)
    missing = [name for name in COLUMNS if name not in header and name not in _OPTIONAL]
    if missing:
        raise TrackError(f"{path}: missing columns {', '.join(missing)}; the header must be {','.join(COLUMNS)}")
    if not rows:
        raise TrackError(f"{path}: holds no samples; give at least a minute of two vehicles or more")
    at = {name: header.index(name) for name in COLUMNS if name in header}
    short = next((number for number, row in enumerate(rows) if len(row) < len(header)), None)
    if short is not None:
        raise TrackError(f"{path}: line {short + 2} has {len(rows[short])} values, the header {len(header)}")
    values = {name: _numbers(path, name, [row[at[name]] for row in rows]) for name in _NUMBERS}
    if values["speed_mps"].min() < 0:
        row = int(values["speed_mps"].argmin())
        raise TrackError(
            f"{path}: speed_mps is {values['speed_mps'][row]:g} in line {row + 2}; speeds are not negative"
        )
    ids = np.array([row[at["id"]].strip() for row in rows])
    types = np.array([row[at["type"]].strip() if "type" in at else "car" for row in rows])
    lanes = np.array([row[at["lane"]].strip() if "lane" in at else "" for row in rows])
    position = np.column_stack([values["x_m"], values["y_m"]])
    _check_order(np.unique(ids, return_inverse=True)[1], values["time_s"], position, values["speed_mps"])
    drives = ~np.isin(np.char.lower(types), _ON_FOOT)
    if not drives.any():
        raise TrackError(f"{path}: holds people on foot only; give trajectories of vehicles")
    found = gathered(
        ids[drives],
        types[drives],
        lanes[drives],
        values["time_s"][drives],
        position[drives],
        values["speed_mps"][drives],
        _from_east(values)[drives],
    )
    _check(path, found)
    people = len(np.unique(ids[~drives]))
    return replace(found, notes=(f"{people} people on foot were left out",)) if people else found


def write_tracks(path: Path, tracks: Tracks) -> None:
    """Write a CSV file, in order of time; headings in degrees counter-clockwise from east."""
    order = np.lexsort((tracks.vehicle, np.round(tracks.time_s, 6)))
    with explained(path), path.open("w", encoding="utf-8", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(COLUMNS)
        for row in order.tolist():
            who = int(tracks.vehicle[row])
            x, y = tracks.place[row]
            heading = np.degrees(tracks.heading_rad[row]) % 360
            out.writerow(
                [
                    f"{tracks.time_s[row]:.3f}",
                    tracks.ids[who],
                    *(f"{value:.4f}" for value in (x, y, tracks.speed_mps[row])),
                    f"{heading:.3f}",
                    tracks.lane[row],
                    tracks.types[who],
                ]
            )


def _rows(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = [row for row in csv.reader(file) if row]
    except OSError as error:
        raise TrackError(f"cannot read {path}: {error.strerror}; give the path of a CSV file") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise TrackError(f"{path} is not CSV: {error}; write {','.join(COLUMNS)}") from error
    if not lines:
        raise TrackError(f"{path} is empty; the header must be {','.join(COLUMNS)}")
    return [name.strip() for name in lines[0]], lines[1:]


def _numbers(path: Path, name: str, texts: list[str]) -> np.ndarray:
    try:
        values = np.array(texts, dtype=float)
    except ValueError:
        line, text = next((i, text) for i, text in enumerate(texts) if not _is_number(text))
        raise TrackError(f"{path}: {name} is {text!r} in line {line + 2}; write a number") from None
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise TrackError(
            f"{path}: {name} is {values[bad[0]]} in line {bad[0] + 2} ({len(bad)} such values); leave such samples out"
        )
    return values


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _from_east(values: dict[str, np.ndarray]) -> np.ndarray:
    """Headings counter-clockwise from east."""
    given = np.radians(values["heading_deg"])
    return np.angle(np.exp(1j * given))


def with_true_headings(tracks: Tracks) -> Tracks:
    """Return tracks with headings read as SUMO's (clockwise from north) if the direction of travel agrees."""
    move = np.diff(tracks.place, axis=0)
    apart = np.hypot(move[:, 0], move[:, 1])
    moved = (np.diff(tracks.vehicle) == 0) & (apart > 0.1) & (apart < 50)
    course, heading = np.arctan2(move[:, 1], move[:, 0])[moved], tracks.heading_rad[:-1][moved]
    other = np.pi / 2 - tracks.heading_rad
    if np.cos(course - other[:-1][moved]).sum() <= np.cos(course - heading).sum():
        return tracks
    return replace(tracks, heading_rad=np.angle(np.exp(1j * other)))


def _check_order(vehicle: np.ndarray, time_s: np.ndarray, position: np.ndarray, speed_mps: np.ndarray) -> None:
    """Find a clock that goes back, from samples in the order of the file.

    A vehicle whose time decreases once while it moves on as far as in a usual step shows a change of the clock. In
    files in another order time decreases often, or with positions far apart.

    Args:
        vehicle: (n,) code of the vehicle of each sample.
        time_s: (n,) time of each sample.
        position: (n, 2) position of each sample [m].
        speed_mps: (n,) speed of each sample.

    Raises:
        TrackError: the times of three vehicles or more, or of all that move, go back at the same time.
    """
    order = np.argsort(vehicle, kind="stable")
    same = np.diff(vehicle[order]) == 0
    gap = np.diff(time_s[order])
    usual = gap[same & (gap > 0)]
    if not len(usual):
        return
    move = np.hypot(*np.diff(position[order], axis=0).T)
    fast = speed_mps[order][:-1]
    back = same & (gap < 0)
    near = back & (fast > 2) & (move < 3 * fast * float(np.median(usual)))
    who = vehicle[order][:-1]
    if (np.bincount(who[back]) > 3).any() or not near.any():
        return
    before, by = time_s[order][:-1][near], gap[near]
    at_once = np.abs(before - np.median(before)) < 1 + abs(float(np.median(by)))
    moving = len(np.unique(vehicle[speed_mps > 2]))
    if len(np.unique(who[near][at_once])) >= min(3, moving):
        raise TrackError(
            f"the clock goes back by {-float(np.median(by)):.1f} s after {float(np.median(before)):.2f} s: vehicles "
            "move on without a gap there; correct time_s, or give one part"
        )


def _check(path: Path, tracks: Tracks) -> None:
    if len(tracks.ids) < 2:
        only = next(iter(tracks.ids))
        raise TrackError(f"{path}: holds one vehicle only ({only!r}); give two or more, whose distance can show")

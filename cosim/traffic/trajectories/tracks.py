"""Tracks of road users, sample by sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import CosimError
from cosim.traffic.headings import unit_vectors

GAP_S = 2.1  # who is not seen for longer was away, and is not put in between
_FASTEST_MPS = 90.0
_JITTER_M = 3.0  # of positions, which no speed explains
_MOVES_M = 0.3
_STANDS_M = 0.5
_LARGEST = 1e12  # of times, which may count from 1970, and of places


class TrajectoryError(CosimError):
    """Trajectories that cannot be replayed."""


@dataclass(frozen=True, eq=False)
class RoadTracks:
    """Samples of road users, sorted by user and time.

    Attributes:
        ids: of the u users.
        types: of each, as its file calls it.
        kinds: of each: `car`, `van`, `truck`, `bus`, `tram`, `motorcycle`, `cyclist` or `pedestrian`.
        size: (u, 3) float64 length, width, height [m].
        first: (u + 1,) int: the samples of user k are first[k] to first[k + 1].
        time_s: (n,) float64.
        front: (n, 3) float64 middle of the front bumper, of people on foot their own middle; axes of the town [m]. z is
            NaN where it is unknown.
        heading_rad: (n,) float64 counter-clockwise from east, without jumps of 2π.
        speed_mps: (n,) float64.
        signals: (n,) int64 SUMO's bit set of lamps.
        lanes: n lane ids, empty where unknown.
        sumo_clock: whether times are those of a SUMO simulation, whose signals ran by the same clock.
        notes: what of the file was inferred or left out, a line each.
        inferred: the meaning of a table's columns, for `drive.yaml`; empty for other files.
        undirected: road users of unknown heading, which neither move nor have one.
        derives_speed: most speeds were not measured but derived from positions.
    """

    ids: tuple[str, ...]
    types: tuple[str, ...]
    kinds: tuple[str, ...]
    size: np.ndarray
    first: np.ndarray
    time_s: np.ndarray
    front: np.ndarray
    heading_rad: np.ndarray
    speed_mps: np.ndarray
    signals: np.ndarray
    lanes: tuple[str, ...]
    sumo_clock: bool = False
    notes: tuple[str, ...] = ()
    inferred: Mapping[str, Any] = field(default_factory=dict)
    undirected: tuple[str, ...] = ()
    derives_speed: bool = False

    def __len__(self) -> int:
        return len(self.time_s)

    def samples(self, user: int) -> slice:
        """Rows of a user's samples."""
        return slice(int(self.first[user]), int(self.first[user + 1]))

    def stands(self, user: int) -> bool:
        """Whether a user goes nowhere."""
        return self.way_m(user) < _STANDS_M

    def way_m(self, user: int) -> float:
        """Distance travelled by a user [m]."""
        places = self.front[self.samples(user), :2]
        return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


@dataclass(frozen=True)
class TrackSample:
    """One line of a file.

    Attributes:
        time_s: of the sample.
        user: id.
        x_m, y_m, z_m: middle of the front bumper, or of the body where `centred`; z_m NaN where unknown.
        heading_rad: counter-clockwise from east; NaN where unknown.
        speed_mps: NaN where unknown.
        signals: SUMO's lamps.
        lane: SUMO's lane id, or empty.
    """

    time_s: float
    user: str
    x_m: float
    y_m: float
    z_m: float = np.nan
    heading_rad: float = np.nan
    speed_mps: float = np.nan
    signals: int = 0
    lane: str = ""


@dataclass(frozen=True)
class User:
    """Identity of a road user.

    Attributes:
        type: what the file calls him.
        kind: as `RoadTracks.kinds`.
        size_m: length, width, height.
        middle_ahead_m: how far the middle of his body lies ahead of the places that a file of middles gives.
    """

    type: str
    kind: str
    size_m: tuple[float, float, float]
    middle_ahead_m: float = 0.0


def gather(path: Path, samples: Sequence[TrackSample], users: Mapping[str, User], *, centred: bool) -> RoadTracks:
    """Tracks from samples in any order.

    Args:
        path: for messages.
        samples: of those in `users`; others are passed over.
        users: by id.
        centred: whether places are those of the body's middle.

    Raises:
        TrajectoryError: no track is left, a time or position is not finite, a time occurs twice, or a track jumps.
    """
    kept = sorted((one for one in samples if one.user in users), key=lambda one: (one.user, one.time_s))
    if not kept:
        raise TrajectoryError(f"{path}: holds no sample of a road user; give trajectories of vehicles")
    names = [one.user for one in kept]
    ids = tuple(dict.fromkeys(names))
    counts = np.array([0, *np.unique(names, return_counts=True)[1]])  # in the same order
    first = np.cumsum(counts)
    time_s, speed = (np.array([getattr(one, part) for one in kept], float) for part in ("time_s", "speed_mps"))
    position = np.array([(one.x_m, one.y_m, one.z_m) for one in kept], float)
    heading = np.array([one.heading_rad for one in kept], float)
    _check_numbers(path, kept, time_s, position)
    size = np.array([users[name].size_m for name in ids], float)
    undirected: list[str] = []
    derives_speed = bool(np.isnan(speed).mean() > 0.5)
    for number, name in enumerate(ids):
        rows = slice(first[number], first[number + 1])
        _check_order(path, name, time_s[rows])
        known = _headings(position[rows, :2], heading[rows])
        if known is None:
            undirected.append(name)
        heading[rows] = 0.0 if known is None else known
        if centred and users[name].kind != "pedestrian":
            ahead = unit_vectors(heading[rows])
            position[rows, :2] += ahead * (size[number, 0] / 2 + users[name].middle_ahead_m)
        _check_way(path, name, time_s[rows], position[rows])
        speed[rows] = _speeds(time_s[rows], position[rows, :2], speed[rows])
    return RoadTracks(
        ids=ids,
        types=tuple(users[name].type for name in ids),
        kinds=tuple(users[name].kind for name in ids),
        size=size,
        first=first,
        time_s=time_s,
        front=position,
        heading_rad=heading,
        speed_mps=speed,
        signals=np.array([one.signals for one in kept], np.int64),
        lanes=tuple(one.lane for one in kept),
        undirected=tuple(undirected),
        derives_speed=derives_speed,
    )


def _check_numbers(path: Path, samples: Sequence[TrackSample], time_s: np.ndarray, position: np.ndarray) -> None:
    sound = (np.abs(time_s) < _LARGEST) & (np.abs(position[:, :2]) < _LARGEST).all(1)
    bad = np.flatnonzero(~(sound & ~(np.abs(position[:, 2]) >= _LARGEST)))
    if len(bad):
        one = samples[int(bad[0])]
        raise TrajectoryError(
            f"{path}: {one.user!r} is at ({one.x_m:g}, {one.y_m:g}) m at {one.time_s:g} s; times and places are finite "
            f"numbers below {_LARGEST:g}"
        )


def _check_order(path: Path, name: str, time_s: np.ndarray) -> None:
    twice = np.flatnonzero(np.diff(time_s) <= 0)
    if len(twice):
        raise TrajectoryError(f"{path}: {name!r} has two samples at {time_s[twice[0]]:g} s; keep one")


def _check_way(path: Path, name: str, time_s: np.ndarray, position: np.ndarray) -> None:
    step, way = np.diff(time_s), np.linalg.norm(np.diff(position[:, :2], axis=0), axis=1)
    bad = np.flatnonzero((step <= GAP_S) & (way > _FASTEST_MPS * step + _JITTER_M))
    if len(bad):
        row = int(bad[0])
        raise TrajectoryError(
            f"{path}: {name!r} jumps by {way[row]:.1f} m from {time_s[row]:g} to {time_s[row + 1]:g} s; road users "
            f"move at {_FASTEST_MPS:g} m/s at most: correct the track, or give what follows another id"
        )


def _headings(position: np.ndarray, given: np.ndarray) -> np.ndarray | None:
    """Headings without jumps; where they are unknown, the direction of the way; None without any."""
    if np.isfinite(given).all():
        return np.unwrap(given)
    found = given.copy()
    for row in np.flatnonzero(~np.isfinite(given)):
        found[row] = _course(position, int(row))
    if not np.isfinite(found).any():
        return None
    known = np.flatnonzero(np.isfinite(found))
    unrolled = np.unwrap(found[known])
    return np.interp(np.arange(len(found)), known, unrolled)


def _course(position: np.ndarray, row: int) -> float:
    """Direction of motion around a sample; NaN for stationary road users."""
    away = np.linalg.norm(position - position[row], axis=1)
    far = away > _MOVES_M
    after = np.flatnonzero(far[row:])
    before = np.flatnonzero(far[: row + 1])
    start = int(before[-1]) if len(before) else row
    end = row + int(after[0]) if len(after) else row
    if start == end:
        return float("nan")
    east, north = position[end] - position[start]
    return float(np.arctan2(north, east))


def _speeds(time_s: np.ndarray, position: np.ndarray, given: np.ndarray) -> np.ndarray:
    if np.isfinite(given).all() or len(time_s) < 2:
        return np.nan_to_num(given)
    measured = np.linalg.norm(np.gradient(position, time_s, axis=0), axis=1)
    return np.where(np.isfinite(given), given, measured)

"""Trajectories on their network: place in the lane, limit, leader, and who is parked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosim.driver_discrepancy.network import NetLane, Network
from cosim.driver_discrepancy.settings import DEFAULT
from cosim.driver_discrepancy.tracks import TrackError, Tracks

_BY = DEFAULT.placing
FOUR_WHEELS = ("car", "van", "truck", "bus")


@dataclass(frozen=True, eq=False)
class Placed:
    """Samples in the order of `tracks`, each (n,).

    Attributes:
        tracks, network: what was placed where.
        code: index of `lanes`.
        lanes: ids of lanes with vehicles.
        on: on a lane of cars, inside junctions too.
        along_m: front bumper's distance from the lane's start.
        left_m: how far it is to the left of the lane's middle.
        limit_mps: the lane's limit.
        ends_m: from the front bumper to the lane's end.
        free_lane: a straight lane outside junctions.
        parked: bool, next to the road, stationary.
        acceleration_mps2: from one sample to the next; NaN at a vehicle's last one, and over gaps.
        leader: row of the vehicle ahead on the same lane at the same time; −1 without one within 80 m.
        gap_m: from the front bumper to the leader's rear one; infinite where there is none.
    """

    tracks: Tracks
    network: Network
    code: np.ndarray
    lanes: tuple[str, ...]
    on: np.ndarray
    along_m: np.ndarray
    left_m: np.ndarray
    limit_mps: np.ndarray
    ends_m: np.ndarray
    free_lane: np.ndarray
    parked: np.ndarray
    acceleration_mps2: np.ndarray
    leader: np.ndarray
    gap_m: np.ndarray

    def of_lane(self, values: Callable[[str, NetLane], float]) -> np.ndarray:
        """A property of each sample's lane (n,); NaN off lanes of cars."""
        known = self.network.lanes
        table = [values(name, known[name]) if name in known else np.nan for name in self.lanes]
        return np.array(table, float)[self.code]


def place(tracks: Tracks, network: Network) -> Placed:
    """Place trajectories on a network.

    Raises:
        TrackError: a lane is none of the network's.
    """
    count = len(tracks)
    along, left = np.zeros(count), np.zeros(count)
    limit, ends = np.full(count, np.inf), np.full(count, np.inf)
    on, free, beside = np.zeros(count, bool), np.zeros(count, bool), np.zeros(count, bool)
    names, code = np.unique(tracks.lane.astype(str), return_inverse=True)
    _check(names, network)
    rows = np.argsort(code, kind="stable")
    for name, own in zip(names, np.split(rows, np.cumsum(np.bincount(code))[:-1]), strict=True):
        lane = network.lanes.get(name)
        if lane is None:
            beside[own] = True
            continue
        along[own], left[own] = lane.project(tracks.place[own])
        on[own], limit[own], free[own] = True, lane.limit_mps, lane.straight and not lane.inside
        ends[own] = lane.length_m - along[own]
        beside[own] = np.abs(left[own]) > lane.width_m / 2
    parked = _lasting(tracks, (tracks.speed_mps < _BY.rests_mps) & beside)
    leader, gap = _leaders(tracks, network, code, along, on & ~parked & ~beside)
    acceleration = _acceleration(tracks)
    return Placed(
        tracks,
        network,
        code,
        tuple(names.tolist()),
        on,
        along,
        left,
        limit,
        ends,
        free,
        parked,
        acceleration,
        leader,
        gap,
    )


def kind_of(tracks: Tracks, network: Network) -> np.ndarray:
    """The kind of each vehicle; a car where its type says nothing."""
    types, type_names = network.types, {one.kind for one in network.types.values()}
    return np.array(
        [types[name].kind if name in types else name if name in type_names else "car" for name in tracks.types],
        dtype=object,
    )


def lengths(tracks: Tracks, network: Network) -> np.ndarray:
    """The length of each vehicle [m]."""
    by_kind: dict[str, list[float]] = {}
    for one in network.types.values():
        by_kind.setdefault(one.kind, []).append(one.length_m)
    usual = {kind: float(np.median(found)) for kind, found in by_kind.items()}
    types = network.types
    return np.array(
        [types[name].length_m if name in types else usual.get(name, _BY.usual_length_m) for name in tracks.types], float
    )


def _check(names: np.ndarray, network: Network) -> None:
    unknown = [name for name in names if name and name not in network.lanes and name not in network.others]
    if unknown:
        raise TrackError(
            f"lane {str(unknown[0])!r} is not in the town ({len(unknown)} of {len(names)} lanes are not); "
            "give the configuration of the town that was measured, or correct `lane`"
        )
    if not any(name in network.lanes for name in names):
        raise TrackError("no sample lies on a lane of cars; fill in `lane` with the town's lane ids")


def _lasting(tracks: Tracks, rests: np.ndarray, least_s: float = 2.0) -> np.ndarray:
    """Return stops that last long, or that a vehicle's track starts with."""
    change = (np.diff(rests.astype(np.int8)) != 0) | (np.diff(tracks.vehicle) != 0)
    start = np.concatenate([[0], np.flatnonzero(change) + 1])
    end = np.concatenate([start[1:], [len(rests)]]) - 1
    first = np.concatenate([[True], np.diff(tracks.vehicle) != 0])
    lasts = (tracks.time_s[end] - tracks.time_s[start] >= least_s) | first[start]
    return np.repeat(lasts & rests[start], end - start + 1)


def _acceleration(tracks: Tracks) -> np.ndarray:
    found = np.full(len(tracks), np.nan)
    gap = np.diff(tracks.time_s)
    good = (np.diff(tracks.vehicle) == 0) & (gap < 1.6 * tracks.step_s)
    found[:-1][good] = (np.diff(tracks.speed_mps) / np.where(gap > 0, gap, 1))[good]
    return found


def _leaders(
    tracks: Tracks, network: Network, code: np.ndarray, along: np.ndarray, drives: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    leader, gap = np.full(len(tracks), -1), np.full(len(tracks), np.inf)
    rows = np.flatnonzero(drives)
    if len(rows) < 2:
        return leader, gap
    instant = np.round((tracks.time_s - tracks.start_s) / max(tracks.step_s, 1e-3)).astype(np.int64)
    rows = rows[np.lexsort((along[rows], code[rows], instant[rows]))]
    behind, ahead = rows[:-1], rows[1:]
    pairs = (instant[behind] == instant[ahead]) & (code[behind] == code[ahead])
    behind, ahead = behind[pairs], ahead[pairs]
    size = lengths(tracks, network)[tracks.vehicle[ahead]]
    clear = along[ahead] - along[behind] - size
    near = clear < _BY.leads_m
    leader[behind[near]], gap[behind[near]] = ahead[near], clear[near]
    return leader, gap

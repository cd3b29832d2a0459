"""Poses of vehicles that are parked from the start."""

from __future__ import annotations

import zlib
from dataclasses import replace
from itertools import groupby, pairwise

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour.config import BehaviourConfig
from cosim.traffic.behaviour.roads import Lane, ParkingSpace, Roads
from cosim.traffic.simulation import Traffic

_OFF_LANE_M = 0.05
_ONE_BAY_M = 0.5  # lots this near to each other are one bay


class KerbsideParking:
    """Turns parked vehicles a little and, where asked to, sets them in their bays one behind the other.

    No vehicle extends into the lane: rotated ones are closer to the kerb, or on it. What does not fit into a bay is
    not there.

    Args:
        config: distributions of yaw and gaps.
        seed: seed of the draws; each depends only on it and on the name of the vehicle or bay.
    """

    def __init__(self, config: BehaviourConfig, seed: int) -> None:
        self._config = config
        self._seed = seed
        self._poses: dict[str, tuple[np.ndarray, float]] = {}  # front (2,) and heading
        self._settled = False

    def arrange(self, traffic: Traffic, roads: Roads, actors: Actors) -> Actors:
        """The actors of a step; once some are parked these take their places, and those without one leave."""
        if self._settled or not actors.parked.any():
            return actors
        self._settled = True
        actors = actors.without(self._settle(traffic, roads, actors))
        rows = [row for row, name in enumerate(actors.ids) if name in self._poses]
        front, heading = actors.front.copy(), actors.heading_rad.copy()
        for row in rows:
            front[row, :2], heading[row] = self._poses[actors.ids[row]]
            traffic.stand(actors.ids[row], *self._poses[actors.ids[row]])
        self._poses.clear()
        return replace(actors, front=front, heading_rad=heading)

    def _settle(self, traffic: Traffic, roads: Roads, actors: Actors) -> set[str]:
        """Place the vehicles of a lot; return those that do not fit."""
        lots = {lot.id: lot for places in roads.lots.values() for lot in places}
        stand: list[tuple[ParkingSpace, int]] = []
        for row in np.flatnonzero(actors.parked).tolist():
            stops = traffic.api.vehicle.getStops(actors.ids[row], 1)
            if stops and stops[0].stoppingPlaceID in lots:
                stand.append((lots[stops[0].stoppingPlaceID], row))
        stand.sort(key=lambda one: (one[0].lane, one[0].start_m))
        ends = self._in_bays(roads, actors, stand) if self._config.parked_gap_m is not None else {}
        gone: set[str] = set()
        for lot, row in stand:
            end = ends.get(row, lot.end_m) if self._config.parked_gap_m is not None else lot.end_m
            if end is None:
                gone.add(actors.ids[row])
                traffic.remove(actors.ids[row])
            else:
                lane = roads.lanes[lot.lane]
                self._poses[actors.ids[row]] = self._pose(actors, row, lane, roads.right_room(lane.edge), end)
        return gone

    def _in_bays(self, roads: Roads, actors: Actors, stand: list[tuple[ParkingSpace, int]]) -> dict[int, float | None]:
        """Positions of front bumpers along the lane; None without enough space."""
        gap = self._config.parked_gap_m
        assert gap is not None
        bays: dict[str, tuple[str, float, float]] = {}
        for places in roads.lots.values():
            for _, lots in groupby(places, key=lambda lot: lot.lane):
                for bay in _bays(list(lots)):
                    for lot in bay:
                        bays[lot.id] = (bay[0].id, bay[0].start_m, bay[-1].end_m)
        ends: dict[int, float | None] = {}
        for (name, begin, end), subset in groupby(stand, key=lambda one: bays[one[0].id]):
            rng = np.random.default_rng([self._seed, zlib.crc32(name.encode())])
            at = begin
            for _, row in subset:
                front = at + float(actors.size[row, 0])
                ends[row] = front if front <= end else None
                at = front + gap.draw(rng)
        return ends

    def _pose(self, actors: Actors, row: int, lane: Lane, strip_m: float, end_m: float) -> tuple[np.ndarray, float]:
        rng = np.random.default_rng([self._seed, zlib.crc32(actors.ids[row].encode()), 1])
        yaw = np.radians(self._config.parked_yaw_deg.draw(rng))
        length, width = actors.size[row, :2] / 2
        position, along = lane.point(end_m - float(length))
        heading, right = along + yaw, np.array([np.sin(along), -np.cos(along)])
        forward = np.array([np.cos(heading), np.sin(heading)])
        beside = width * np.array([-np.sin(heading), np.cos(heading)])
        centre = position + (lane.width_m + strip_m) / 2 * right
        corners = [centre + end * length * forward + beside for end in (1, -1)]
        over = max(lane.project(corner)[1] for corner in corners) + lane.width_m / 2 + _OFF_LANE_M  # lanes bend
        centre = centre + max(over, 0.0) * right
        return centre + length * forward, float(heading)


def _bays(lots: list[ParkingSpace]) -> list[list[ParkingSpace]]:
    """Lots next to one lane, in order, separated by gaps."""
    bays = [[lots[0]]]
    for before, lot in pairwise(lots):
        if lot.start_m - before.end_m > _ONE_BAY_M:
            bays.append([])
        bays[-1].append(lot)
    return bays

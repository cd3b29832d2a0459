"""Parked vehicles that drive off."""

from __future__ import annotations

import numpy as np

from cosim.traffic.behaviour.routes import wander
from cosim.traffic.behaviour.stage import Stage, in_axes
from cosim.traffic.motion import drift
from cosim.traffic.motion.rehearsal import clear, rehearse

_KINDS = ("car", "van")
_LENGTHS_M = (9.0, 7.5, 6.0, 5.0, 4.4)
_WAY_M = 16.0
_MARGIN_M = 0.12
_GENTLY_MPS = 2.5
_TRIES = 6
_OFFSET_M = (1.5, 4.0)  # of a space from the lane


class PullOut:
    """At any moment a parked vehicle may pull out, if it can get out forwards between its neighbours."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._due = 0
        self._waiting: dict[str, float] = {}  # vehicle → length of its way out
        self._leaving: dict[str, float] = {}  # vehicle → way left that it drives gently

    def step(self, stage: Stage) -> None:
        """Choose who leaves; note when he does."""
        self._due = min(self._due + stage.due(stage.config.pull_outs_per_min, self._rng), 3)
        if self._due and round(stage.actors.time_s / stage.step_s) % 10 == 0:
            self._due -= self._begin(stage)
        for vehicle in list(self._waiting):
            row = stage.rows.get(vehicle)
            if row is None:
                del self._waiting[vehicle]
            elif not stage.actors.parked[row]:
                stage.record("pull_out", vehicle)
                self._leaving[vehicle] = self._waiting.pop(vehicle) + stage.actors.size[row, 0]
        for vehicle in list(self._leaving):
            self._leave(stage, vehicle)

    def _leave(self, stage: Stage, vehicle: str) -> None:
        row = stage.rows.get(vehicle)
        if row is not None:
            self._leaving[vehicle] -= float(stage.actors.speed_mps[row]) * stage.step_s
            if self._leaving[vehicle] > 0:
                return
            stage.api.vehicle.setSpeed(vehicle, -1)
        stage.pace.pop(vehicle, None)
        del self._leaving[vehicle]
        stage.busy.discard(vehicle)

    def _begin(self, stage: Stage) -> bool:
        actors = stage.actors
        rows = [
            row
            for row in np.flatnonzero(actors.parked).tolist()
            if actors.kinds[row] in _KINDS and not stage.engaged(actors.ids[row])
        ]
        for _ in range(min(_TRIES, len(rows))):
            row = rows[int(self._rng.integers(len(rows)))]
            if self._try(stage, row):
                return True
        return False

    def _try(self, stage: Stage, row: int) -> bool:
        actors, vehicle = stage.actors, stage.actors.ids[row]
        stops = stage.api.vehicle.getStops(vehicle, 1)
        lane = stage.roads.lanes.get(stops[0].lane) if stops else None
        if lane is None:
            return False
        position = actors.front[row, :2]
        at, left = lane.project(position)
        if not _OFFSET_M[0] < -left < _OFFSET_M[1] or lane.length_m - at < _WAY_M:
            return False
        heading = lane.point(at)[1]
        askew = float((actors.heading_rad[row] - heading + np.pi) % (2 * np.pi) - np.pi)
        boxes = in_axes(stage.boxes_near(position, vehicle), position, heading)
        boxes = boxes[boxes[:, 1] < -left / 2]  # others at the kerb; those on the lane SUMO waits for
        size = actors.size[row]
        for length in _LENGTHS_M:

            def offset(x: np.ndarray, length: float = length) -> np.ndarray:
                return -left * (1 - drift.steep(x / length))

            poses = rehearse(actors.kinds[row], size[0], _WAY_M, offset, askew)
            if clear(poses, size, boxes, _MARGIN_M):
                return self._set_off(stage, vehicle, lane.edge, length)
        return False

    def _set_off(self, stage: Stage, vehicle: str, edge: str, length: float) -> bool:
        route = wander(stage, vehicle, edge, self._rng)
        if route is None:
            return False
        api = stage.api.vehicle
        api.setRoute(vehicle, route)
        api.resume(vehicle)
        api.setSpeed(vehicle, _GENTLY_MPS)
        stage.pace[vehicle] = _GENTLY_MPS
        stage.motion.leave_steeply(vehicle, length)
        stage.busy.add(vehicle)
        self._waiting[vehicle] = length
        return True

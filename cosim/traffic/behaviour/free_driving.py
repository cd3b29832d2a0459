"""Speed, gap and place in the lane: what drivers do all the time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.traffic.behaviour.habits import Habits, draw_habits
from cosim.traffic.behaviour.roads import Lane
from cosim.traffic.behaviour.stage import Stage
from cosim.traffic.behaviour.vehicle_parameters import set_parameters

MOTORISED = frozenset({"car", "van", "truck", "bus", "motorcycle"})
_BRAKES_MPS2 = 2.5
_EARLY_M = 8.0
_SPARE_M = 0.2  # between a body and the edge of its lane, at least
_CYCLISTS_OFF_KERB_M = 0.15  # SUMO lets them touch vehicles parked next to the lane


@dataclass(eq=False)
class _Driver:
    habits: Habits
    lane: str = ""
    free_factor: float = 1.0
    corner_mps: float = np.inf
    length_m: float = np.inf
    factor: float = -1.0


class FreeDriving:
    """Gives every driver his habits when he is first seen, and lets him exceed limits between corners.

    SUMO multiplies every limit with a vehicle's speed factor, those of corners too; so the factor is set again on every
    lane, and is 1 in corners and where one must be braked for.
    """

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._drivers: dict[str, _Driver] = {}

    def step(self, stage: Stage) -> None:
        """Look after everyone's speed."""
        actors, api = stage.actors, stage.api
        for vehicle in stage.left:  # SUMO does with them as it likes, until they come again
            self._drivers.pop(vehicle, None)
        positions, speeds = actors.lane_position_m.tolist(), actors.speed_mps.tolist()
        parked = actors.parked.tolist()
        for row, (vehicle, kind, lane) in enumerate(zip(actors.ids, actors.kinds, actors.lanes, strict=True)):
            if kind == "cyclist" and vehicle not in self._drivers:
                self._drivers[vehicle] = _Driver(draw_habits(stage.config, self._seed, vehicle))
                stage.motion.keep_offset(vehicle, _CYCLISTS_OFF_KERB_M)
            if kind not in MOTORISED or parked[row] or not lane:
                continue
            driver = self._drivers.get(vehicle)
            if driver is None:
                driver = self._drivers[vehicle] = self._begin(stage, vehicle)
            if driver.lane != lane:
                driver.lane = lane
                self._enter(stage, vehicle, driver, stage.roads.lanes.get(lane))
            factor = driver.free_factor
            corner = driver.corner_mps
            if factor > 1.0 and corner < np.inf:
                braking = (speeds[row] ** 2 - corner * corner) / (2 * _BRAKES_MPS2)
                if driver.length_m - positions[row] < braking + _EARLY_M:
                    factor = 1.0
            if factor != driver.factor:
                driver.factor = factor
                api.vehicle.setSpeedFactor(vehicle, factor)

    def habits(self, stage: Stage, vehicle: str) -> Habits:
        """The habits of a vehicle's driver."""
        if vehicle not in self._drivers:
            return draw_habits(stage.config, self._seed, vehicle)
        return self._drivers[vehicle].habits

    def _begin(self, stage: Stage, vehicle: str) -> _Driver:
        habits = draw_habits(stage.config, self._seed, vehicle)
        set_parameters(stage.api.vehicle, vehicle, habits, stage.step_s)
        row = stage.rows[vehicle]
        lane = stage.roads.lanes.get(stage.actors.lanes[row])
        spare = (lane.width_m - float(stage.actors.size[row, 1])) / 2 - _SPARE_M if lane else 0.0
        room = max(spare, 0.0)
        stage.motion.keep_offset(vehicle, float(np.clip(habits.lane_offset_m, -room, room)))
        return _Driver(habits)

    def _enter(self, stage: Stage, vehicle: str, driver: _Driver, lane: Lane | None) -> None:
        driver.corner_mps, driver.length_m, driver.free_factor = np.inf, np.inf, 1.0
        if lane is None:
            return
        bend = stage.roads.bends.get(lane.id, np.inf)
        driver.free_factor = min(driver.habits.speed_factor(lane.limit_mps), max(1.0, bend / lane.limit_mps))
        if lane.edge.startswith(":") or driver.free_factor <= 1.0:
            return
        route, at = stage.api.vehicle.getRoute(vehicle), stage.api.vehicle.getRouteIndex(vehicle)
        onward = lane.onward.get(route[at + 1]) if at + 1 < len(route) else None
        if onward is None:
            onward = min(lane.onward.values(), default=np.inf)
        if onward < lane.limit_mps * driver.free_factor:
            driver.corner_mps, driver.length_m = onward, lane.length_m

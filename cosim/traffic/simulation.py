"""One SUMO simulation, stepped and read as arrays."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from types import ModuleType
from typing import Self

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.lane_limits import scale_limits, slow_for_bends
from cosim.traffic.longer_routes import LongerRoutes
from cosim.traffic.road_users import RoadUsers
from cosim.traffic.route_corners import RouteCorners
from cosim.traffic.starting import SavedState, TrafficError, describe_stop, start_sumo
from cosim.traffic.street_speed import StreetSpeed
from cosim.traffic.subscriptions import Subscriptions

_CHANGES_LANE = {"lcMaxSpeedLatStanding": "0", "lcMaxSpeedLatFactor": "0.25"}  # no sliding sideways at rest
_PARKED_FROM_S = 1.0  # SUMO inserts parked vehicles on the lane first, and takes some steps to park all
_NEAR_STOP_M = 0.5
_FAR_DECIDES_S = 1.0  # who is left to SUMO thinks once a second: that takes a quarter of the time
_CAREFUL = 31  # SUMO's speed mode with all checks


class Traffic:
    """A running simulation; a context manager, one at a time in a process.

    Everyone is read after every step, until `attend` names those who matter: the others are left to SUMO, which then
    decides for them once a second, and are read only when `distant` asks.

    Args:
        sumocfg: scenario file.
        seed: SUMO's seed.
        step_s: step length [s].
        state: saved state to start from (`cosim.traffic.warm_up.WarmUp`); by default an empty network.
        as_given: leave lanes, lane changes, vehicle types and drivers as the scenario has them, instead of slowing for
            corners, changing lanes gradually, keeping long vehicles out of tight corners, and deciding seldom far away.
        cornering_mps2: lateral acceleration to which lanes are limited in bends; by default 2.8 unless `as_given`.
        street_speed: streets whose limits are multiplied.

    Raises:
        TrafficError: SUMO refuses the scenario, or another simulation runs in this process.
    """

    def __init__(
        self,
        sumocfg: Path,
        seed: int,
        step_s: float = 0.1,
        state: SavedState | None = None,
        *,
        as_given: bool = False,
        cornering_mps2: float | None = None,
        street_speed: StreetSpeed | None = None,
    ) -> None:
        self.step_s = step_s
        self._as_given = as_given
        self._sumo = start_sumo(sumocfg, seed, step_s, state=state, sublane=not as_given)
        self._began_s = self.time_s
        constants = self._sumo.constants
        self._vehicle_variables = [
            constants.VAR_POSITION3D,
            constants.VAR_ANGLE,
            constants.VAR_SPEED,
            constants.VAR_ACCELERATION,
            constants.VAR_LANE_ID,
            constants.VAR_LANEPOSITION,
            constants.VAR_SIGNALS,
            constants.VAR_TYPE,
        ]
        self._person_variables = [
            constants.VAR_POSITION3D,
            constants.VAR_ANGLE,
            constants.VAR_SPEED,
            constants.VAR_LANE_ID,
            constants.VAR_TYPE,
            constants.VAR_VEHICLE,
        ]
        self._users = RoadUsers(self._sumo)
        self._readings = Subscriptions(constants)
        self._looks_now: tuple[tuple[str, ...], tuple[str, ...], np.ndarray] = ((), (), np.zeros((0, 3)))
        self._headings: tuple[tuple[str, ...], np.ndarray] = ((), np.zeros(0))
        self._parked: dict[str, dict] = {}
        self._driving: set[str] = set()
        self._walking: set[str] = set()
        self._far: dict[str, float] = {}  # how often they decided before [s]
        self._far_walking: set[str] = set()
        self._near_parked: dict[str, dict] | None = None  # None: all of them
        self._arriving: set[str] = set()
        self._hidden: set[str] = set()
        self._routes = LongerRoutes(self._sumo)
        if cornering_mps2 is not None or not as_given:
            slow_for_bends(self._sumo, cornering_mps2)
        if street_speed is not None:
            scale_limits(self._sumo, street_speed)
        self._corners = RouteCorners(self._sumo)
        if state is not None:
            self._take_over()
        self._subscribe()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the simulation."""
        self._sumo.close()

    @property
    def time_s(self) -> float:
        """Simulation time."""
        return float(self._sumo.simulation.getTime())

    @property
    def api(self) -> ModuleType:
        """The running libsumo, for what this class has no word for."""
        return self._sumo

    def hide(self, vehicle: str) -> None:
        """Leave a vehicle out of the actors from now on: it only keeps a place free."""
        self._hidden.add(vehicle)

    def remove(self, vehicle: str) -> None:
        """Take a vehicle out of the simulation."""
        self._sumo.vehicle.unsubscribe(vehicle)
        self._sumo.vehicle.remove(vehicle)
        self._driving.discard(vehicle)
        self._far.pop(vehicle, None)
        self._unpark(vehicle)

    def stand(self, vehicle: str, front: np.ndarray, heading_rad: float) -> None:
        """Set the pose of a parked vehicle, front bumper (2,) and heading, for as long as it is parked."""
        constants, values = self._sumo.constants, self._parked[vehicle]
        values[constants.VAR_POSITION3D] = (float(front[0]), float(front[1]), values[constants.VAR_POSITION3D][2])
        values[constants.VAR_ANGLE] = 90.0 - float(np.degrees(heading_rad))
        self._readings.forget_parked()

    @property
    def far(self) -> frozenset[str]:
        """Vehicles that drive and are left to SUMO."""
        return frozenset(self._far)

    def dispatched(self, vehicle: str) -> bool:
        """Return whether SUMO dispatches a vehicle to passengers (taxi device); then its route must not be changed."""
        return self._users.dispatched(vehicle)

    def places(self) -> tuple[list[str], list[str], list[str], np.ndarray]:
        """Names of moving and parked vehicles and pedestrians, and their positions in this order, (n, 2) [m]."""
        api, constants = self._sumo, self._sumo.constants
        driving, parked = sorted(self._driving | self._far.keys()), sorted(self._parked)
        walking = sorted(self._walking | self._far_walking)
        places = [api.vehicle.getPosition(name) for name in driving]
        places += [self._parked[name][constants.VAR_POSITION3D][:2] for name in parked]
        places += [api.person.getPosition(name) for name in walking]
        return driving, parked, walking, np.array(places, float).reshape(-1, 2)

    def attend(self, driving: Collection[str], parked: Collection[str], walking: Collection[str]) -> None:
        """Read only these road users from now on, and new ones; the others are left to SUMO."""
        api, wanted = self._sumo.vehicle, set(driving)
        for vehicle in sorted(self._driving - wanted):
            self._leave_to_sumo(vehicle)
        for vehicle in sorted(self._far.keys() & wanted):
            decides_s = self._far.pop(vehicle)
            if not self._as_given:
                api.setActionStepLength(vehicle, decides_s)
            self._attend_vehicle(vehicle)
        wanted = set(walking)
        for person in sorted(self._walking - wanted):
            self._sumo.person.unsubscribe(person)
        for person in sorted(self._far_walking & wanted):
            self._sumo.person.subscribe(person, self._person_variables)
        everybody = self._walking | self._far_walking
        self._walking, self._far_walking = everybody & wanted, everybody - wanted
        if self._near_parked is None or self._near_parked.keys() != set(parked):
            self._near_parked = {name: self._parked[name] for name in parked}
            self._readings.forget_parked()

    def distant(self) -> Actors:
        """All who are not read step by step, as SUMO has them now; they have no yaw rates."""
        api, constants = self._sumo, self._sumo.constants
        vehicle, person = api.vehicle, api.person
        far, walking = sorted(self._far), sorted(self._far_walking)
        near = self._parked if self._near_parked is None else self._near_parked
        parked = {name: self._parked[name] for name in sorted(self._parked.keys() - near.keys())}
        getters = {
            constants.VAR_POSITION3D: "getPosition3D",
            constants.VAR_ANGLE: "getAngle",
            constants.VAR_SPEED: "getSpeed",
            constants.VAR_ACCELERATION: "getAcceleration",
            constants.VAR_LANE_ID: "getLaneID",
            constants.VAR_LANEPOSITION: "getLanePosition",
            constants.VAR_SIGNALS: "getSignals",
            constants.VAR_TYPE: "getTypeID",
            constants.VAR_VEHICLE: "getVehicle",
        }
        requested = [(variable, getattr(vehicle, getters[variable])) for variable in self._vehicle_variables]
        vehicles = {name: {variable: get(name) for variable, get in requested} for name in far}
        requested = [(variable, getattr(person, getters[variable])) for variable in self._person_variables]
        persons = {name: {variable: get(name) for variable, get in requested} for name in walking}
        readings = Subscriptions(constants)
        readings.read(vehicles, self._outside(persons), parked)
        heading = np.radians(90.0 - readings.angle_deg)
        return self._actors(readings, heading, np.zeros(len(heading)), *self._users.looks(readings.types))

    def advance(self, steps: int) -> Actors:
        """Go on by some steps and read everyone as SUMO has them.

        Raises:
            TrafficError: SUMO gave up.
        """
        for _ in range(steps - 1):
            self.step()
        return self.step()

    def step(self) -> Actors:
        """Go on by one step and read everyone as SUMO has them.

        Raises:
            TrafficError: SUMO gave up.
        """
        before_s = self.time_s
        try:
            self._sumo.simulationStep()
        except (self._sumo.TraCIException, self._sumo.FatalTraCIError) as error:
            raise TrafficError(f"SUMO stopped at {before_s:.1f} s: {describe_stop(str(error))}") from error
        self._subscribe()
        self._rest()
        return self._read()

    def prolong_route(self, vehicle: str, rng: np.random.Generator) -> None:
        """Give a vehicle that nears its destination another one, so that it keeps driving; not taxis and trams."""
        if not self.dispatched(vehicle) and not self._users.on_rails(vehicle):
            self._routes.prolong(vehicle, rng)

    def _subscribe(self) -> None:
        """Subscribe to vehicles that have just entered or leave a parking space."""
        for vehicle in self._sumo.simulation.getDepartedIDList():
            if vehicle not in self._hidden and self._users.shows(self._sumo.vehicle, vehicle):
                if not self._as_given and not self._users.on_rails(vehicle):
                    self._corners.fit(vehicle)
                if self._begins_parked(vehicle):
                    self._arriving.add(vehicle)
                    continue
                self._enter(vehicle)
        for vehicle in self._sumo.simulation.getParkingEndingVehiclesIDList():
            if self._unpark(vehicle):
                self._attend_vehicle(vehicle)
        for vehicle in self._sumo.simulation.getArrivedIDList():
            self._driving.discard(vehicle)
            self._far.pop(vehicle, None)
        for person in self._sumo.simulation.getDepartedPersonIDList():
            if self._users.shows(self._sumo.person, person):
                self._attend_person(person)
        for person in self._sumo.simulation.getArrivedPersonIDList():
            self._walking.discard(person)
            self._far_walking.discard(person)

    def _take_over(self) -> None:
        """Subscribe to those whom a saved state holds."""
        api = self._sumo
        for vehicle in sorted(api.vehicle.getIDList()):
            if not self._users.shows(api.vehicle, vehicle):
                continue
            if not self._as_given and not self._users.on_rails(vehicle):
                self._corners.fit(vehicle)
            self._enter(vehicle)
            if api.vehicle.isStoppedParking(vehicle):
                self._park(vehicle, {**api.vehicle.getSubscriptionResults(vehicle), **self._stationary})
        for person in sorted(api.person.getIDList()):
            if self._users.shows(api.person, person):
                self._attend_person(person)

    def _enter(self, vehicle: str) -> None:
        self._attend_vehicle(vehicle)
        for name, value in () if self._as_given else _CHANGES_LANE.items():
            self._sumo.vehicle.setParameter(vehicle, f"laneChangeModel.{name}", value)

    def _attend_vehicle(self, vehicle: str) -> None:
        self._sumo.vehicle.subscribe(vehicle, self._vehicle_variables)
        self._driving.add(vehicle)

    def _attend_person(self, person: str) -> None:
        self._sumo.person.subscribe(person, self._person_variables)
        self._walking.add(person)

    def _leave_to_sumo(self, vehicle: str) -> None:
        """Revoke all commands to a vehicle."""
        api = self._sumo.vehicle
        api.unsubscribe(vehicle)
        api.setSpeed(vehicle, -1)
        api.setSpeedMode(vehicle, _CAREFUL)
        decides_s = api.getActionStepLength(vehicle)
        if not self._as_given:
            api.setSpeedFactor(vehicle, 1.0)
            api.setActionStepLength(vehicle, max(_FAR_DECIDES_S, self.step_s))
        self._driving.discard(vehicle)
        self._far[vehicle] = decides_s

    def _begins_parked(self, vehicle: str) -> bool:
        api = self._sumo.vehicle
        stops = api.getStops(vehicle, 1) if self.time_s < self._began_s + _PARKED_FROM_S else ()
        if not stops or not stops[0].stoppingPlaceID or stops[0].lane != api.getLaneID(vehicle):
            return False
        return abs(stops[0].endPos - api.getLanePosition(vehicle)) < _NEAR_STOP_M

    @property
    def _stationary(self) -> dict[int, float]:
        constants = self._sumo.constants
        return {constants.VAR_SPEED: 0.0, constants.VAR_ACCELERATION: 0.0}

    def _rest(self) -> None:
        """Read newly parked vehicles a last time: they do not move, and are the majority of road users."""
        api = self._sumo.vehicle
        for vehicle in self._sumo.simulation.getParkingStartingVehiclesIDList():
            if vehicle in self._far:
                api.subscribe(vehicle, self._vehicle_variables)
            if vehicle in self._driving or vehicle in self._far:  # asking for others would subscribe to nothing
                self._park(vehicle, {**api.getSubscriptionResults(vehicle), **self._stationary})
        if self._arriving and self.time_s > self._began_s + _PARKED_FROM_S:
            for vehicle in sorted(self._arriving):
                self._attend_vehicle(vehicle)
                if api.isStoppedParking(vehicle):
                    self._park(vehicle, {**api.getSubscriptionResults(vehicle), **self._stationary})
            self._arriving.clear()

    def _park(self, vehicle: str, values: dict) -> None:
        self._parked[vehicle] = values
        if self._near_parked is not None:
            self._near_parked[vehicle] = values
        self._readings.forget_parked()
        self._sumo.vehicle.unsubscribe(vehicle)
        self._driving.discard(vehicle)
        self._far.pop(vehicle, None)

    def _unpark(self, vehicle: str) -> bool:
        """Count a vehicle to the parked no more; whether it was one."""
        if self._parked.pop(vehicle, None) is None:
            return False
        if self._near_parked is not None:
            self._near_parked.pop(vehicle, None)
        self._readings.forget_parked()
        return True

    def _read(self) -> Actors:
        sumo, now = self._sumo, self._readings
        vehicles, persons = sumo.vehicle.getAllSubscriptionResults(), sumo.person.getAllSubscriptionResults()
        persons = self._outside(persons)
        if now.read(vehicles, persons, self._parked if self._near_parked is None else self._near_parked):
            self._looks_now = self._users.looks(now.types)
        heading = np.radians(90.0 - now.angle_deg)
        turned = np.angle(np.exp(1j * (heading - self._headings_before(now.ids, heading))))
        self._headings = now.ids, heading
        return self._actors(now, heading, turned / self.step_s, *self._looks_now)

    def _outside(self, persons: Mapping[str, dict]) -> Mapping[str, dict]:
        """Values of persons without those who ride: they are within a body."""
        vehicle = self._sumo.constants.VAR_VEHICLE
        if not any(values[vehicle] for values in persons.values()):
            return persons
        return {name: values for name, values in persons.items() if not values[vehicle]}

    def _actors(
        self,
        now: Subscriptions,
        heading: np.ndarray,
        yaw_rate: np.ndarray,
        types: tuple[str, ...],
        kinds: tuple[str, ...],
        sizes: np.ndarray,
    ) -> Actors:
        return Actors(
            time_s=self.time_s,
            ids=now.ids,
            types=types,
            kinds=kinds,
            lanes=tuple(now.lanes),
            front=now.front.copy(),
            heading_rad=np.angle(np.exp(1j * heading)),
            speed_mps=now.numbers["speed_mps"].copy(),
            acceleration_mps2=now.numbers["acceleration_mps2"].copy(),
            yaw_rate_radps=yaw_rate,
            size=sizes,
            signals=now.numbers["signals"].astype(np.int64),
            lane_position_m=now.numbers["lane_position_m"].copy(),
            parked=now.parked.copy(),
            lateral_mps=np.zeros(len(now.ids)),
            body_pitch_rad=np.zeros(len(now.ids)),
            body_roll_rad=np.zeros(len(now.ids)),
        )

    def _headings_before(self, ids: tuple[str, ...], heading: np.ndarray) -> np.ndarray:
        """Headings of the step before (n,); the present ones of those who have just come."""
        names, before = self._headings
        if names == ids:
            return before
        known = dict(zip(names, before.tolist(), strict=True))
        return np.array([known.get(name, angle) for name, angle in zip(ids, heading.tolist(), strict=True)], float)

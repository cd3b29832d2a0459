"""One SUMO simulation, stepped and read as arrays."""

from __future__ import annotations

import contextlib
import logging
import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any, Self

import numpy as np

from cosim.errors import CosimError
from cosim.traffic.actors import Actors
from cosim.traffic.motion.corners import corner_speed
from cosim.traffic.route_corners import RouteCorners
from cosim.traffic.subscriptions import Subscriptions

# SUMO vehicle class → kind of road user
KIND_OF_CLASS = {
    "passenger": "car",
    "private": "car",
    "taxi": "car",
    "hov": "car",
    "evehicle": "car",
    "emergency": "van",
    "delivery": "van",
    "truck": "truck",
    "trailer": "truck",
    "bus": "bus",
    "coach": "bus",
    "motorcycle": "motorcycle",
    "moped": "motorcycle",
    "bicycle": "cyclist",
    "custom1": "car",
    "custom2": "car",
    "ignoring": "car",
    "authority": "car",
    "vip": "car",
    "army": "truck",
    "scooter": "cyclist",
    "pedestrian": "pedestrian",
    "wheelchair": "pedestrian",
}
_RIDDEN = ("car", "van", "truck", "bus", "motorcycle", "cyclist")  # what carries the sensors, the first that drives
_log = logging.getLogger(__name__)
_SUBLANE_M = 0.8  # lane changes take their time; SUMO's own default is a jump
_CHANGES_LANE = {"lcMaxSpeedLatStanding": "0", "lcMaxSpeedLatFactor": "0.25"}  # no sliding sideways at rest
_FEW_EDGES_LEFT = 4
_TRIES_TO_EXTEND, _TRIES_STRAIGHT_ON = 20, 12
_PARKED_FROM_S = 0.6  # SUMO puts who begins parked on the lane first, and takes some steps to park all
_NEAR_STOP_M = 0.5
_MOVES_MPS = 1.0


class TrafficError(CosimError):
    """SUMO refuses the scenario, or the simulation cannot go on."""


@dataclass(frozen=True)
class _TypeInfo:
    kind: str
    size: tuple[float, float, float]


class Traffic:
    """A running simulation; a context manager, one at a time in a process.

    Args:
        sumocfg: scenario file.
        seed: SUMO's seed.
        step_s: step length [s].
        as_given: leave lanes, lane changes and vehicle types as the scenario has them, instead of slowing for corners,
            changing lanes gradually and keeping long vehicles out of tight corners.

    Raises:
        TrafficError: SUMO refuses the scenario, or another simulation runs in this process.
    """

    def __init__(self, sumocfg: Path, seed: int, step_s: float = 0.1, *, as_given: bool = False) -> None:
        self.step_s = step_s
        self._as_given = as_given
        self._sumo = _start(
            [
                "sumo",
                *("-c", str(sumocfg)),
                *("--seed", str(seed % 2**31)),
                *("--step-length", str(step_s)),
                *("--time-to-teleport", "-1"),
                *(() if as_given else ("--lateral-resolution", str(_SUBLANE_M))),
                *("--collision.action", "warn"),
                *("--collision.mingap-factor", "0"),
                "--no-step-log",
                "--no-warnings",
            ]
        )
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
        self._types: dict[str, _TypeInfo] = {}
        self._readings = Subscriptions(constants)
        self._types_now: tuple[str, ...] = ()
        self._kinds_now: tuple[str, ...] = ()
        self._sizes_now = np.zeros((0, 3))
        self._headings: tuple[tuple[str, ...], np.ndarray] = ((), np.zeros(0))
        self._parked: dict[str, dict] = {}
        self._arriving: set[str] = set()
        self._hidden: set[str] = set()
        self._open: dict[str, list[str]] = {}  # vClass → edges
        self._classes_left_out: set[str] = set()
        if not as_given:
            self._slow_for_corners()
        self._corners = RouteCorners(self._sumo)
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
        if self._parked.pop(vehicle, None) is not None:
            self._readings.forget_parked()

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
        try:
            self._sumo.simulationStep()
        except self._sumo.TraCIException as error:
            raise TrafficError(f"SUMO stopped at {self.time_s:.1f} s: {error}") from error
        self._subscribe()
        self._rest()
        return self._read()

    def draw_ego(self, actors: Actors, rng: np.random.Generator) -> str:
        """The id of a vehicle to ride in: a car that drives, drawn at random; without cars, of the next kind.

        Raises:
            TrafficError: nothing drives.
        """
        driving = self._driving(actors)
        if not driving:
            raise TrafficError(f"no road vehicle drives after {actors.time_s:.0f} s; lengthen warm_up_s or add traffic")
        kind = min((actors.kinds[row] for row in driving), key=_RIDDEN.index)
        driving = [row for row in driving if actors.kinds[row] == kind]
        moving = [row for row in driving if actors.speed_mps[row] > _MOVES_MPS]
        return str(rng.choice(sorted(actors.ids[row] for row in moving or driving)))

    def anybody_drives(self, actors: Actors) -> bool:
        """Whether there is a vehicle to ride in."""
        return bool(self._driving(actors))

    def anybody_comes(self) -> bool:
        """Whether SUMO still expects somebody, on the road or later."""
        return self._sumo.simulation.getMinExpectedNumber() > 0

    def _driving(self, actors: Actors) -> list[int]:
        """Rows of who is on the road without a stop ahead; of who moves, if all have one (buses, shared taxis)."""
        kinds, lanes = actors.kinds, actors.lanes
        on_road = [row for row in range(len(actors)) if kinds[row] in _RIDDEN and lanes[row] and not actors.parked[row]]
        free = [row for row in on_road if not self._sumo.vehicle.getStops(actors.ids[row], 1)]
        return free or [row for row in on_road if actors.speed_mps[row] > _MOVES_MPS]

    def prolong_route(self, vehicle: str, rng: np.random.Generator) -> None:
        """Give a vehicle that nears its destination another one, so that it keeps driving."""
        api = self._sumo.vehicle
        route = api.getRoute(vehicle)
        if len(route) - api.getRouteIndex(vehicle) > _FEW_EDGES_LEFT:
            return
        vehicle_class, vtype = api.getVehicleClass(vehicle), _shared_type(api.getTypeID(vehicle))
        edges = self._open_edges(vehicle_class)
        for number in range(_TRIES_TO_EXTEND):
            way = self._sumo.simulation.findRoute(route[-1], str(rng.choice(edges)), vtype).edges
            if len(way) > _FEW_EDGES_LEFT and (number >= _TRIES_STRAIGHT_ON or not self._turns_back(way)):
                api.setRoute(vehicle, [*route[api.getRouteIndex(vehicle) :], *way[1:]])
                return

    def _open_edges(self, vehicle_class: str) -> list[str]:
        """Edges with a lane that a vClass may use; sidewalks are lanes too."""
        if vehicle_class not in self._open:
            api = self._sumo
            closed = api.lane.getDisallowed
            self._open[vehicle_class] = [
                edge
                for edge in sorted(api.edge.getIDList())
                if not edge.startswith(":")
                and any(vehicle_class not in closed(f"{edge}_{i}") for i in range(api.edge.getLaneNumber(edge)))
            ]
        return self._open[vehicle_class]

    def _turns_back(self, way: Sequence[str]) -> bool:
        """Whether a way goes back somewhere on the street it came on."""
        api = self._sumo.edge
        return any(api.getFromJunction(one) == api.getToJunction(other) for one, other in pairwise(way))

    def _subscribe(self) -> None:
        """Subscribe to whoever has just entered or leaves his parking place."""
        for vehicle in self._sumo.simulation.getDepartedIDList():
            if vehicle not in self._hidden and self._is_shown(self._sumo.vehicle, vehicle):
                if not self._as_given:
                    self._corners.fit(vehicle)
                if self._begins_parked(vehicle):
                    self._arriving.add(vehicle)
                    continue
                self._sumo.vehicle.subscribe(vehicle, self._vehicle_variables)
                for name, value in () if self._as_given else _CHANGES_LANE.items():
                    self._sumo.vehicle.setParameter(vehicle, f"laneChangeModel.{name}", value)
        for vehicle in self._sumo.simulation.getParkingEndingVehiclesIDList():
            if self._parked.pop(vehicle, None) is not None:
                self._readings.forget_parked()
                self._sumo.vehicle.subscribe(vehicle, self._vehicle_variables)
        for person in self._sumo.simulation.getDepartedPersonIDList():
            if self._is_shown(self._sumo.person, person):
                self._sumo.person.subscribe(person, self._person_variables)

    def _is_shown(self, api: Any, name: str) -> bool:
        """Whether somebody is a road user; trains, ships and the like are left out, which is said once a class."""
        vehicle_class = self._sumo.vehicletype.getVehicleClass(api.getTypeID(name))
        if vehicle_class in KIND_OF_CLASS:
            return True
        if vehicle_class not in self._classes_left_out:
            self._classes_left_out.add(vehicle_class)
            _log.warning("who has vClass %r is not shown: only road users and people on foot are", vehicle_class)
        return False

    def _slow_for_corners(self) -> None:
        """Limit lanes to what their bends allow: SUMO takes corners at 5.5 m/s² sideways, and faster."""
        api = self._sumo.lane
        for lane in api.getIDList():
            comfortable = corner_speed(np.array(api.getShape(lane)))
            if comfortable < api.getMaxSpeed(lane) and not _on_foot(api.getAllowed(lane)):
                api.setMaxSpeed(lane, comfortable)

    def _begins_parked(self, vehicle: str) -> bool:
        api = self._sumo.vehicle
        stops = api.getStops(vehicle, 1) if self.time_s < self._began_s + _PARKED_FROM_S else ()
        if not stops or not stops[0].stoppingPlaceID or stops[0].lane != api.getLaneID(vehicle):
            return False
        return abs(stops[0].endPos - api.getLanePosition(vehicle)) < _NEAR_STOP_M

    def _rest(self) -> None:
        """Read those who have just parked a last time: they stand still, and most road users are they."""
        constants, api = self._sumo.constants, self._sumo.vehicle
        still = {constants.VAR_SPEED: 0.0, constants.VAR_ACCELERATION: 0.0}
        for vehicle in self._sumo.simulation.getParkingStartingVehiclesIDList():
            values = {} if vehicle in self._arriving else api.getSubscriptionResults(vehicle)
            if values:
                self._park(vehicle, {**values, **still})
        if self._arriving and self.time_s > self._began_s + _PARKED_FROM_S:
            for vehicle in sorted(self._arriving):
                api.subscribe(vehicle, self._vehicle_variables)
                if api.isStoppedParking(vehicle):
                    self._park(vehicle, {**api.getSubscriptionResults(vehicle), **still})
            self._arriving.clear()

    def _park(self, vehicle: str, values: dict) -> None:
        self._parked[vehicle] = values
        self._readings.forget_parked()
        self._sumo.vehicle.unsubscribe(vehicle)

    def _read(self) -> Actors:
        sumo, now = self._sumo, self._readings
        vehicles, persons = sumo.vehicle.getAllSubscriptionResults(), sumo.person.getAllSubscriptionResults()
        inside = [name for name, values in persons.items() if values[sumo.constants.VAR_VEHICLE]]
        if inside:  # those who ride are within a body
            persons = {name: values for name, values in persons.items() if name not in inside}
        if now.read(vehicles, persons, self._parked):
            self._types_now = tuple(_shared_type(name) for name in now.types)
            infos = [self._type(name) for name in self._types_now]
            self._kinds_now = tuple(info.kind for info in infos)
            self._sizes_now = np.array([info.size for info in infos], float).reshape(-1, 3)
        heading = np.radians(90.0 - now.angle_deg)
        turned = np.angle(np.exp(1j * (heading - self._headings_before(now.ids, heading))))
        self._headings = now.ids, heading
        return Actors(
            time_s=self.time_s,
            ids=now.ids,
            types=self._types_now,
            kinds=self._kinds_now,
            lanes=tuple(now.lanes),
            front=now.front.copy(),
            heading_rad=np.angle(np.exp(1j * heading)),
            speed_mps=now.numbers["speed_mps"].copy(),
            acceleration_mps2=now.numbers["acceleration_mps2"].copy(),
            yaw_rate_radps=turned / self.step_s,
            size=self._sizes_now,
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

    def _type(self, name: str) -> _TypeInfo:
        if name not in self._types:
            api = self._sumo.vehicletype
            vehicle_class = api.getVehicleClass(name)
            if vehicle_class not in KIND_OF_CLASS:
                known = ", ".join(sorted(KIND_OF_CLASS))
                raise TrafficError(f"vType {name!r} has vClass {vehicle_class!r}; cosim shows only {known}")
            size = (api.getLength(name), api.getWidth(name), api.getHeight(name))
            self._types[name] = _TypeInfo(KIND_OF_CLASS[vehicle_class], size)
        return self._types[name]


def _shared_type(name: str) -> str:
    """The vType that SUMO made a single vehicle's own type from."""
    return name.partition("@")[0]


def _on_foot(allowed: Sequence[str]) -> bool:
    return tuple(allowed) == ("pedestrian",)


def _start(command: list[str]) -> ModuleType:
    """Start libsumo; what it complains of becomes the error's line instead of noise on the terminal."""
    try:
        import libsumo
    except ImportError as error:
        raise TrafficError(f"SUMO's library cannot be loaded: {error}; run `sh tools/setup.sh`") from error

    if libsumo.simulation.isLoaded():
        raise TrafficError("a SUMO simulation already runs in this process; close it first or use another process")
    with _captured_stderr() as complaints:
        try:
            libsumo.start(command)
        except (libsumo.TraCIException, libsumo.FatalTraCIError, RuntimeError) as error:
            lines = [line.strip() for line in complaints().splitlines() if line.strip()]
            errors = [line for line in lines if line.startswith("Error")] or lines or [str(error)]
            raise TrafficError(f"SUMO refuses {command[2]}: {errors[0].removeprefix('Error: ')}") from error
    return libsumo


@contextlib.contextmanager
def _captured_stderr() -> Iterator:
    """Collect what native code writes to the standard error stream."""
    with tempfile.TemporaryFile() as sink:
        kept = os.dup(2)
        os.dup2(sink.fileno(), 2)

        def text() -> str:
            sink.seek(0)
            return sink.read().decode(errors="replace")

        try:
            yield text
        finally:
            os.dup2(kept, 2)
            os.close(kept)

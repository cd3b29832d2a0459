"""People about parked cars: at a door on the street's side, behind the boot, at a door on the kerb's side."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour.roads import Lane, Roads
from cosim.traffic.headings import unit_vectors
from cosim.traffic.motion import Motion, overlaps
from cosim.traffic.simulation import Traffic

_KERB, _END, _STREET = 0, 1, 2  # positions, in the order of the path round the car
_OFTEN = (0.3, 0.25, 0.45)
_STAYS_S = (8.0, 40.0)
_GAP_M = (0.02, 0.15)  # between body and car
_DOOR_AT = (-0.05, 0.15)  # of the car's length before its middle
_WALKS_MPS, _HURRIES_MPS = 0.9, 1.8
_LOOKS_M = 60.0
_STEPS_OUT_S, _STEPS_BACK_S = 9.0, 5.0  # no vehicle comes by so soon
_NEAR_M = 3.0
_SETS_OFF_MPS = 4.0  # speed that stationary or slow vehicles may soon have
_STANDS_MPS = 0.1
_LOOKS_ROUND_S = 0.7
_CLEAR_M = 0.25  # between passing bodies
_LATEST_ROOM_S = 2.0  # who has not made room by then will not
_SHIFTS_MPS = 0.4
_MAKE_ROOM = ("car", "van")
_ROUND_BENDS_M = 12.0  # beyond this distance a vehicle's position is predicted along its lane
_ELBOW_M = 0.1
_NEIGHBOURS_M = 9.0
_BODY_REACH_M = 20.0


@dataclass(eq=False)
class _Person:
    """A person near a parked car; the path round the car is in the car's axes (x forward, y left, from its centre).

    Attributes:
        car, kind_of_body: names of vehicle and vType.
        size: (3,) length, width, height [m].
        way: (4, 2) from the kerb's door round a corner to the car's end and on round another to the street's door.
        stations: (3,) of kerb, end and street along the way [m].
        lane: lane next to the car.
        wants, until_s: where to, and until when one stays there.
        at_m: place along the way.
        rest: pose while one stays, as `_walk` gives it, and the state of person and car that it depends on.
    """

    car: str
    kind_of_body: str
    size: np.ndarray
    way: np.ndarray
    stations: np.ndarray
    lane: Lane
    wants: int
    until_s: float
    at_m: float
    rng: np.random.Generator
    rest: tuple[tuple[float, ...], list[float]] = ((), [])

    @property
    def name(self) -> str:
        return f"by_{self.car}"

    @cached_property
    def corner_m(self) -> float:
        """Distance along the path at which it reaches the street, less half a body length."""
        return float(self.stations[_STREET] - np.linalg.norm(self.way[3] - self.way[2]) - self.size[1] / 2)

    @property
    def in_street(self) -> bool:
        """Whether one is past the corner on the street's side, or in it."""
        return self.at_m > self.corner_m

    @property
    def looks(self) -> bool:
        """Whether one must know who passes: in the street, and on the way there."""
        return self.in_street or self.wants == _STREET

    def place(self, at_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Place (2,) and direction (2,) of the way at a distance along it."""
        pieces, length, along = self._pieces
        k = min(int(np.searchsorted(along, at_m, side="right")) - 1, len(pieces) - 1)
        return self.way[k] + pieces[k] * (at_m - along[k]) / length[k], pieces[k] / length[k]

    @cached_property
    def _pieces(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pieces of the way (3, 2), their lengths (3,), and stations of its corners (4,) [m]."""
        pieces = np.diff(self.way, axis=0)
        length = np.linalg.norm(pieces, axis=1)
        return pieces, length, np.concatenate([[0.0], np.cumsum(length)])


class Bystanders:
    """Adds people near some of the parked vehicles, and keeps them out of the way of traffic.

    They walk round their vehicle between its doors and its rear, wait at each, enter the street only when it is clear,
    and return when a vehicle would pass too near. Others treat them as obstacles (`cosim.traffic.motion`); their own
    vehicle does not leave meanwhile.

    Args:
        share: share of the parked vehicles that have a person near them [1].
        seed: seed of all draws; those of a person depend only on it and on the vehicle's name.
        roads: the network.

    Attributes:
        cars: vehicles that people are about.
    """

    def __init__(self, share: float, seed: int, roads: Roads) -> None:
        self._share = share
        self._seed = seed
        self._roads = roads
        self._people: dict[str, _Person] = {}
        self._ids: tuple[str, ...] = ()
        self._rows: dict[str, int] = {}
        self._seen: set[str] = set()  # driving or parked: no person is added near a car that has just arrived
        self._bodies: list[tuple[str, np.ndarray]] | None = None
        self._usual_m: dict[str, float] = {}  # places in their lanes of those who make room
        self.cars: set[str] = set()

    def join(self, traffic: Traffic, motion: Motion, actors: Actors) -> Actors:
        """Return the actors of a step, followed by the people near parked vehicles.

        Args:
            traffic: the running simulation.
            motion: motion of the vehicles, which are made to keep clear of people in the street.
            actors: as SUMO has them.
        """
        if self._share == 0:
            return actors
        is_same = actors.ids == self._ids
        if not is_same:
            self._ids, self._rows = actors.ids, {name: row for row, name in enumerate(actors.ids)}
        rows = self._rows
        left = [car for car in self._people if car not in rows or not actors.parked[rows[car]]]
        for car in left:
            del self._people[car]
            self._seen.discard(car)
        for row in np.flatnonzero(actors.parked).tolist():
            if actors.ids[row] not in self._seen:
                self._come(traffic, actors, row)
        if left or not is_same:
            self._seen.update(name for name, kind in zip(actors.ids, actors.kinds, strict=True) if kind != "pedestrian")
            self._seen &= rows.keys()
        self.cars.clear()
        self.cars.update(self._people)
        if not self._people and not self._usual_m:
            return actors
        driving = cache(lambda: _driving(motion, actors))  # most people stand still and need not look
        passers: dict[str, list[_Passer]] = {}
        poses = []
        for car, person in sorted(self._people.items()):
            self._decide(person, actors.time_s)
            passers[car] = _passers_by(person, (actors, rows[car]), driving()) if person.looks else []
            poses.append(self._walk(person, passers[car], driving, (actors, rows[car]), traffic.step_s))
        self._make_room(motion, passers, traffic.step_s)
        return actors.and_then(self._as_actors(actors, np.array(poses))) if poses else actors

    def _come(self, traffic: Traffic, actors: Actors, row: int) -> None:
        """Add a person near a parked vehicle with the configured probability if its neighbours leave room."""
        car = actors.ids[row]
        rng = np.random.default_rng([self._seed, zlib.crc32(car.encode()), 2])
        bodies = self._parked_bodies(traffic)
        if rng.random() >= self._share or not bodies or actors.kinds[row] not in ("car", "van"):
            return
        stops = traffic.api.vehicle.getStops(car, 1)
        lane = self._roads.lanes.get(stops[0].lane) if stops else None
        if lane is None:
            return
        body, size = bodies[int(rng.integers(len(bodies)))]
        door, gap = rng.uniform(*_DOOR_AT), rng.uniform(*_GAP_M)
        for end in (-1.0, 1.0) if rng.random() < 0.75 else (1.0, -1.0):  # the boot rather than the bonnet
            way, stations = _way_round(actors.size[row], size, door, gap, end)
            if self._free(actors, row, way, size):
                wants = int(rng.choice(3, p=_OFTEN))
                until_s = actors.time_s + rng.uniform(0.0, _STAYS_S[1])
                at_m = float(stations[wants if wants != _STREET else _END])  # steps out when the road is clear
                self._people[car] = _Person(car, body, size, way, stations, lane, wants, until_s, at_m, rng)
                return

    def _parked_bodies(self, traffic: Traffic) -> list[tuple[str, np.ndarray]]:
        """vTypes of people on foot that the scenario defines, with their sizes (3,)."""
        if self._bodies is None:
            api = traffic.api.vehicletype
            names = [name for name in sorted(api.getIDList()) if not name.startswith("DEFAULT_") and "@" not in name]
            self._bodies = [
                (name, np.array([api.getLength(name), api.getWidth(name), api.getHeight(name)]))
                for name in names
                if api.getVehicleClass(name) == "pedestrian"
            ]
        return self._bodies

    def _free(self, actors: Actors, row: int, way: np.ndarray, size: np.ndarray) -> bool:
        """Return whether the path round this vehicle is free of other vehicles."""
        wheeled = np.array([kind != "pedestrian" for kind in actors.kinds], bool)
        wheeled[row] = False
        centre, heading = _middle(actors, row), actors.heading_rad[row]
        near = np.flatnonzero(wheeled & (np.hypot(*(actors.front[:, :2] - centre).T) < _NEIGHBOURS_M)).tolist()
        others = np.array([_middle(actors, other) for other in near]).reshape(-1, 2)
        room = np.full((3, 2), max(size[:2]) + 2 * _ELBOW_M)
        spots = centre + _turned(way[:3], heading)  # the last lies in the lane
        boxes = np.concatenate([spots, others]), np.concatenate([np.full(3, heading), actors.heading_rad[near]])
        found = overlaps(*boxes, np.concatenate([room, actors.size[near, :2]]))
        alone = self._people.keys().isdisjoint(actors.ids[other] for other in near)  # gaps are for one
        return alone and not ((found.first < 3) & (found.second >= 3)).any()

    @staticmethod
    def _decide(person: _Person, now_s: float) -> None:
        """Choose the next destination."""
        if now_s >= person.until_s:
            person.wants = person.wants + int(person.rng.choice((-1, 1))) if person.wants == _END else _END
            person.until_s = now_s + person.rng.uniform(*_STAYS_S)

    @staticmethod
    def _walk(
        person: _Person,
        passers: list[_Passer],
        driving: Callable[[], Actors],
        car: tuple[Actors, int],
        step_s: float,
    ) -> list[float]:
        """One step; gives x, y, height and heading."""
        goal, hurries = float(person.stations[person.wants]), False
        if person.in_street:
            threats = [passer for passer in passers if passer.threatens(_STEPS_BACK_S)]
            hurries = bool(threats)
            if threats:
                back_s = (person.at_m - person.corner_m) / _HURRIES_MPS + _LOOKS_ROUND_S
                in_time = all(passer.in_s > back_s or passer.stands for passer in threats)
                goal = float(person.stations[_END]) if in_time else person.at_m  # or makes himself small
        elif person.wants == _STREET and any(passer.threatens(_STEPS_OUT_S) for passer in passers):
            goal = float(person.stations[_END])
        actors, row = car
        state = (goal, *actors.front[row].tolist(), float(actors.heading_rad[row]))
        if goal == person.at_m and state == person.rest[0]:
            return person.rest[1]
        middle, heading = _middle(actors, row), float(actors.heading_rad[row])
        pace = _HURRIES_MPS if hurries else _WALKS_MPS
        onward = person.at_m + float(np.clip(goal - person.at_m, -pace * step_s, pace * step_s))
        looks_m = np.clip(goal, onward - _ELBOW_M, onward + _ELBOW_M)
        if onward != person.at_m and _blocked(
            middle + _turned(person.place(looks_m)[0][None], heading), person, driving()
        ):
            goal = onward = person.at_m
        person.at_m = onward
        position, ahead = person.place(person.at_m)
        if abs(goal - person.at_m) > 1e-6:
            ahead = ahead * np.sign(goal - person.at_m)
        elif goal == person.stations[_END]:
            ahead = -position
        x, y = middle + _turned(position[None], heading)[0]
        pose = [x, y, actors.front[row, 2], heading + float(np.arctan2(ahead[1], ahead[0]))]
        if goal == person.at_m:
            person.rest = state, pose
        return pose

    def _make_room(self, motion: Motion, passers: dict[str, list[_Passer]], step_s: float) -> None:
        """Make passing vehicles keep clear of people in the street, as far as their lane width allows."""
        wanted: dict[str, float] = {}
        for car, person in self._people.items():
            for passer in passers[car] if person.in_street else ():
                if passer.shift_m is not None and passer.in_s < _STEPS_OUT_S:
                    wanted[passer.name] = max(wanted.get(passer.name, -np.inf), passer.shift_m)
        for name in sorted(wanted.keys() - self._usual_m.keys()):
            self._usual_m[name] = motion.offset(name)
        for name, usual_m in list(self._usual_m.items()):
            now = motion.offset(name)
            goal = max(usual_m, now + wanted.get(name, -np.inf))
            motion.keep_offset(name, now + float(np.clip(goal - now, -_SHIFTS_MPS * step_s, _SHIFTS_MPS * step_s)))
            if name not in wanted and now == usual_m:
                del self._usual_m[name]

    def _as_actors(self, actors: Actors, poses: np.ndarray) -> Actors:
        people = [person for _, person in sorted(self._people.items())]
        n = len(people)
        still = np.zeros(n)
        return replace(
            actors,
            ids=tuple(person.name for person in people),
            types=tuple(person.kind_of_body for person in people),
            kinds=("pedestrian",) * n,
            lanes=("",) * n,
            front=poses[:, :3],
            heading_rad=np.angle(np.exp(1j * poses[:, 3])),
            size=np.array([person.size for person in people]),
            signals=np.zeros(n, np.int64),
            parked=np.zeros(n, bool),
            **{name: still.copy() for name in _STILL},
        )


@dataclass(frozen=True)
class _Passer:
    """A vehicle that comes by a parked one.

    Attributes:
        name: who.
        in_s: until it is there; zero while it passes.
        apart_m: lateral clearance of its body from a person at the door on the street side.
        shift_m: how much farther left it would keep away and still be in its lane; none where it cannot.
        stands: whether it is stationary.
    """

    name: str
    in_s: float
    apart_m: float
    shift_m: float | None
    stands: bool

    def threatens(self, within_s: float) -> bool:
        """Whether it will soon pass too close to a person in the street and cannot keep clear."""
        makes_room = self.shift_m is not None and self.in_s > _LATEST_ROOM_S
        return self.in_s < within_s and self.apart_m < _CLEAR_M and not makes_room


def _driving(motion: Motion, actors: Actors) -> Actors:
    """Those who drive, where their bodies are rather than where SUMO wants them."""
    wheeled = np.array([kind != "pedestrian" for kind in actors.kinds], bool)
    driving = actors.take(np.flatnonzero(~actors.parked & wheeled))
    front, heading = motion.poses(driving)
    return replace(driving, front=np.column_stack([front, driving.front[:, 2]]), heading_rad=heading)


def _blocked(position: np.ndarray, person: _Person, driving: Actors) -> bool:
    """Return whether a person at a position (1, 2) would touch one of the moving vehicles."""
    near = np.flatnonzero(np.hypot(*(driving.front[:, :2] - position).T) < _BODY_REACH_M).tolist()
    centre = np.concatenate([position, [_middle(driving, row) for row in near]]) if len(near) else position
    room = np.full((1, 2), max(person.size[:2]) + _ELBOW_M)
    heading = np.concatenate([np.zeros(1), driving.heading_rad[near]])
    found = overlaps(centre, heading, np.concatenate([room, driving.size[near, :2]]))
    return bool((found.first == 0).any())


def _passers_by(person: _Person, car: tuple[Actors, int], driving: Actors) -> list[_Passer]:
    """Those of the driving who come by a person's vehicle, which is a row of the actors."""
    centre, heading = _middle(*car), float(car[0].heading_rad[car[1]])
    door, lane, reach = person.way[3], person.lane, float(person.size[1]) / 2
    street = person.way[2:, 0]  # from the corner to the door
    standing = lane.project(centre + _turned(door[None], heading)[0])[1]
    found = []
    rows = np.flatnonzero(np.hypot(*(driving.front[:, :2] - centre).T) < _LOOKS_M)
    turn, half = driving.heading_rad[rows] - heading, driving.size[rows, :2] / 2
    cos, sin = np.cos(turn), np.sin(turn)
    longs = np.abs(cos) * half[:, 0] + np.abs(sin) * half[:, 1]
    wides = np.abs(sin) * half[:, 0] + np.abs(cos) * half[:, 1]
    middles = driving.front[rows, :2] - half[:, :1] * unit_vectors(driving.heading_rad[rows])
    onwards = np.sign(cos) * np.where(driving.speed_mps[rows] < 0, -1, 1)
    columns = (rows, longs, wides, onwards, *_turned(middles - centre, -heading).T)
    for i, (row, long, wide, onward, x, y) in enumerate(zip(*(column.tolist() for column in columns), strict=True)):
        middle, width = middles[i], driving.size[row, 1]
        left = (onward * street).min() - onward * x - long - reach  # until it is there
        if onward * x - long > (onward * street).max() + reach:
            continue
        aside, shift = y - door[1], None
        if driving.lanes[row] == lane.id:
            position = lane.project(middle)[1]
            if abs(x) > _ROUND_BENDS_M:
                aside, wide = position - standing, width / 2
            needed = standing + reach + _CLEAR_M + _ELBOW_M + width / 2
            if driving.kinds[row] in _MAKE_ROOM and needed < (lane.width_m - width) / 2:
                shift = float(needed - position)
        speed = abs(float(driving.speed_mps[row]))
        in_s = max(left - _NEAR_M, 0.0) / max(speed, _SETS_OFF_MPS)
        found.append(_Passer(driving.ids[row], in_s, float(abs(aside) - wide - reach), shift, speed < _STANDS_MPS))
    return found


_STILL = (
    *("speed_mps", "acceleration_mps2", "yaw_rate_radps", "lane_position_m"),
    *("lateral_mps", "body_pitch_rad", "body_roll_rad"),
)


def _way_round(
    car: np.ndarray, body: np.ndarray, door: float, gap_m: float, end: float
) -> tuple[np.ndarray, np.ndarray]:
    """Way (4, 2) from the kerb's door round one end of a car to the street's door, and stations (3,) on it [m]."""
    beside = car[1] / 2 + gap_m + body[1] / 2  # along the car at its doors, towards it at its end
    behind = end * (car[0] / 2 + gap_m + body[0] / 2)
    at = door * car[0]
    way = np.array([[at, -beside], [behind, -beside], [behind, beside], [at, beside]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    return way, np.array([0.0, (along[1] + along[2]) / 2, along[3]])


def _middle(actors: Actors, row: int) -> np.ndarray:
    heading = actors.heading_rad[row]
    return actors.front[row, :2] - actors.size[row, 0] / 2 * np.array([np.cos(heading), np.sin(heading)])


def _turned(points: np.ndarray, angle_rad: float) -> np.ndarray:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.column_stack([points[:, 0] * cos - points[:, 1] * sin, points[:, 0] * sin + points[:, 1] * cos])

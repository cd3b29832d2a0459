"""People about parked cars: at a door on the street's side, behind the boot, at a door on the kerb's side."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour.roads import Lane, Roads
from cosim.traffic.motion import Motion, overlaps
from cosim.traffic.simulation import Traffic

_KERB, _END, _STREET = 0, 1, 2  # where one stands, in the order of the way round the car
_OFTEN = (0.3, 0.25, 0.45)
_STAYS_S = (8.0, 40.0)
_GAP_M = (0.05, 0.30)  # between body and car
_DOOR_AT = (-0.05, 0.15)  # of the car's length before its middle
_WALKS_MPS, _HURRIES_MPS = 0.9, 1.8
_LOOKS_M = 60.0
_STEPS_OUT_S, _STEPS_BACK_S = 9.0, 5.0  # no vehicle comes by so soon
_NEAR_M = 5.0  # at rest, too
_CLEAR_M = 0.25  # between passing bodies
_LATEST_ROOM_S = 2.0  # who has not made room by then will not
_SHIFTS_MPS = 0.4
_MAKE_ROOM = ("car", "van")
_ROUND_BENDS_M = 12.0  # farther away a vehicle's place is told along its lane
_ELBOW_M = 0.1


@dataclass(eq=False)
class _Person:
    """Somebody by a parked car, in whose axes (x forward, y left, from its middle) the way round it lies.

    Attributes:
        car, kind_of_body: names of vehicle and vType.
        size: (3,) length, width, height [m].
        way: (4, 2) from the kerb's door round a corner to the car's end and on round another to the street's door.
        stations: (3,) of kerb, end and street along the way [m].
        lane: beside which the car stands.
        wants, until_s: where to, and until when one stays there.
        at_m: place along the way.
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

    @property
    def name(self) -> str:
        return f"by_{self.car}"

    def place(self, at_m: float) -> tuple[np.ndarray, np.ndarray]:
        """Place (2,) and direction (2,) of the way at a distance along it."""
        pieces = np.diff(self.way, axis=0)
        length = np.linalg.norm(pieces, axis=1)
        along = np.concatenate([[0.0], np.cumsum(length)])
        k = min(int(np.searchsorted(along, at_m, side="right")) - 1, len(pieces) - 1)
        return self.way[k] + pieces[k] * (at_m - along[k]) / length[k], pieces[k] / length[k]


class Bystanders:
    """Lets people stand by some of the parked vehicles, and keeps them from under the others' wheels.

    They walk round their vehicle between its doors and its end, stay a while at each, step into the street only when
    nobody comes, and back when somebody would pass too near. Others see them as obstacles (`cosim.traffic.motion`);
    while they are about, theirs does not drive off.

    Args:
        share: of the parked vehicles that have somebody about them [1].
        seed: of all draws; each person's follow from it and the vehicle's name alone.
        roads: the network.

    Attributes:
        cars: vehicles that people are about.
    """

    def __init__(self, share: float, seed: int, roads: Roads) -> None:
        self._share = share
        self._seed = seed
        self._roads = roads
        self._people: dict[str, _Person] = {}
        self._seen: set[str] = set()  # driving or parked: nobody appears by a car that has just come
        self._bodies: list[tuple[str, np.ndarray]] | None = None
        self._usual_m: dict[str, float] = {}  # places in their lanes of those who make room
        self.cars: set[str] = set()

    def join(self, traffic: Traffic, motion: Motion, actors: Actors) -> Actors:
        """The actors of a step and after them everybody who is about a parked vehicle.

        Args:
            traffic: the running simulation.
            motion: that smooths it, where drivers are told to make room.
            actors: as SUMO has them.
        """
        if self._share == 0:
            return actors
        rows = {name: row for row, name in enumerate(actors.ids)}
        for car in [car for car in self._people if car not in rows or not actors.parked[rows[car]]]:
            del self._people[car]
            self._seen.discard(car)
        for row in np.flatnonzero(actors.parked).tolist():
            if actors.ids[row] not in self._seen:
                self._come(traffic, actors, row)
        self._seen.update(name for name, kind in zip(actors.ids, actors.kinds, strict=True) if kind != "pedestrian")
        self._seen &= rows.keys()
        self.cars.clear()
        self.cars.update(self._people)
        if not self._people and not self._usual_m:
            return actors
        poses = []
        for car, person in sorted(self._people.items()):
            self._decide(person, actors, rows[car])
            poses.append(self._walk(person, actors, rows[car], traffic.step_s))
        self._make_room(motion, actors, traffic.step_s)
        if not poses:
            return actors
        return actors.and_then(self._as_actors(actors, np.array(poses)))

    def _come(self, traffic: Traffic, actors: Actors, row: int) -> None:
        """Perhaps let somebody stand by a parked vehicle, where its neighbours leave room."""
        car = actors.ids[row]
        rng = np.random.default_rng([self._seed, zlib.crc32(car.encode()), 2])
        bodies = self._known_bodies(traffic)
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
                at_m = float(stations[wants if wants != _STREET else _END])  # steps out when nobody comes
                self._people[car] = _Person(car, body, size, way, stations, lane, wants, until_s, at_m, rng)
                return

    def _known_bodies(self, traffic: Traffic) -> list[tuple[str, np.ndarray]]:
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
        """Whether no other vehicle stands where the way round this one goes."""
        wheeled = np.array([kind != "pedestrian" for kind in actors.kinds], bool)
        wheeled[row] = False
        centre, heading = _middle(actors, row), actors.heading_rad[row]
        near = wheeled & (np.hypot(*(actors.front[:, :2] - centre).T) < 15.0)
        others = np.array([_middle(actors, other) for other in np.flatnonzero(near)]).reshape(-1, 2)
        room = np.full((3, 2), max(size[:2]) + 2 * _ELBOW_M)
        spots = centre + _turned(way[:3], heading)  # the last lies in the lane
        boxes = np.concatenate([spots, others]), np.concatenate([np.full(3, heading), actors.heading_rad[near]])
        found = overlaps(*boxes, np.concatenate([room, actors.size[near, :2]]))
        return not ((found.first < 3) & (found.second >= 3)).any()

    def _decide(self, person: _Person, actors: Actors, row: int) -> None:
        """Where to next."""
        now = actors.time_s
        if now >= person.until_s:
            person.wants = person.wants + int(person.rng.choice((-1, 1))) if person.wants == _END else _END
            person.until_s = now + person.rng.uniform(*_STAYS_S)

    def _walk(self, person: _Person, actors: Actors, row: int, step_s: float) -> list[float]:
        """One step; gives x, y, height and heading."""
        out = self._in_street(person)
        goal = float(person.stations[person.wants])
        hurries = False
        if person.wants == _STREET or out:
            hurries = out and self._somebody_passes(person, actors, row, _STEPS_BACK_S)
            if hurries or (not out and self._somebody_passes(person, actors, row, _STEPS_OUT_S)):
                goal = float(person.stations[_END])
        pace = _HURRIES_MPS if hurries else _WALKS_MPS
        person.at_m += float(np.clip(goal - person.at_m, -pace * step_s, pace * step_s))
        place, ahead = person.place(person.at_m)
        arrived = abs(goal - person.at_m) < 1e-6
        looks = np.arctan2(*-place[::-1]) if arrived else np.arctan2(*(ahead * np.sign(goal - person.at_m))[::-1])
        heading = float(actors.heading_rad[row])
        x, y = _middle(actors, row) + _turned(place[None], heading)[0]
        return [x, y, actors.front[row, 2], heading + looks]

    def _somebody_passes(self, person: _Person, actors: Actors, row: int, within_s: float) -> bool:
        """Whether a vehicle that does not make room comes by too near to who stands at the street's door."""
        for passer in _passers(person, actors, row):
            makes_room = passer.room_m is not None and passer.in_s > _LATEST_ROOM_S
            if passer.in_s < within_s and passer.apart_m < _CLEAR_M and not makes_room:
                return True
        return False

    def _make_room(self, motion: Motion, actors: Actors, step_s: float) -> None:
        """Let those who drive by keep away from who stands in the street, as far as their lane is wide."""
        rows = {name: row for row, name in enumerate(actors.ids)}
        wanted: dict[str, float] = {}
        for car, person in sorted(self._people.items()):
            if self._in_street(person):
                for passer in _passers(person, actors, rows[car]):
                    if passer.room_m is not None and passer.in_s < _STEPS_OUT_S:
                        name = actors.ids[passer.row]
                        wanted[name] = max(wanted.get(name, -np.inf), passer.room_m)
        for name in sorted(wanted.keys() - self._usual_m.keys()):
            self._usual_m[name] = motion.offset(name)
        for name, usual_m in list(self._usual_m.items()):
            goal, now = max(usual_m, wanted.get(name, usual_m)), motion.offset(name)
            motion.keep_offset(name, now + float(np.clip(goal - now, -_SHIFTS_MPS * step_s, _SHIFTS_MPS * step_s)))
            if name not in rows or (name not in wanted and now == usual_m):
                del self._usual_m[name]

    @staticmethod
    def _in_street(person: _Person) -> bool:
        corner = float(person.stations[_STREET] - np.linalg.norm(person.way[3] - person.way[2]))
        return person.at_m > corner - person.size[1] / 2

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
        row: of the actors.
        in_s: until it is there; zero while it passes.
        apart_m: how far its body keeps from who stands at the street's door, sideways.
        room_m: place in its lane where it would keep away, if it can.
    """

    row: int
    in_s: float
    apart_m: float
    room_m: float | None


def _passers(person: _Person, actors: Actors, row: int) -> list[_Passer]:
    centre, heading = _middle(actors, row), float(actors.heading_rad[row])
    door, lane, reach = person.way[3], person.lane, float(max(person.size[:2])) / 2
    wheeled = ~actors.parked & np.array([kind != "pedestrian" for kind in actors.kinds], bool)
    wheeled &= np.hypot(*(actors.front[:, :2] - centre).T) < _LOOKS_M
    standing = lane.project(centre + _turned(door[None], heading)[0])[1]
    found = []
    for other in np.flatnonzero(wheeled).tolist():
        turn, (length, width) = float(actors.heading_rad[other] - heading), actors.size[other, :2]
        long = abs(np.cos(turn)) * length / 2 + abs(np.sin(turn)) * width / 2
        wide = abs(np.sin(turn)) * length / 2 + abs(np.cos(turn)) * width / 2
        x, y = _turned((_middle(actors, other) - centre)[None], -heading)[0]
        onward = np.sign(np.cos(turn)) * (-1 if actors.speed_mps[other] < 0 else 1)
        left = (door[0] - x) * onward - long - reach  # until it is there
        if left < -2 * (long + reach):
            continue
        aside, room = y - door[1], None
        if actors.lanes[other] == lane.id:
            if abs(x) > _ROUND_BENDS_M:
                aside, wide = lane.project(_middle(actors, other))[1] - standing, width / 2
            needed = standing + reach + _CLEAR_M + _ELBOW_M + width / 2
            if actors.kinds[other] in _MAKE_ROOM and needed < (lane.width_m - width) / 2:
                room = float(needed)
        in_s = max(left - _NEAR_M, 0.0) / max(abs(float(actors.speed_mps[other])), 0.1)
        found.append(_Passer(other, in_s, float(abs(aside) - wide - reach), room))
    return found


_STILL = (
    *("speed_mps", "acceleration_mps2", "yaw_rate_radps", "lane_position_m"),
    *("lateral_mps", "body_pitch_rad", "body_roll_rad"),
)


def _way_round(
    car: np.ndarray, body: np.ndarray, door: float, gap_m: float, end: float
) -> tuple[np.ndarray, np.ndarray]:
    """Way (4, 2) from the kerb's door round one end of a car to the street's door, and stations (3,) on it [m]."""
    beside = car[1] / 2 + gap_m + max(body[:2]) / 2
    behind = end * (car[0] / 2 + gap_m + max(body[:2]) / 2)
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

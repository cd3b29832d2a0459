"""State that the behaviours of one step share."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import ModuleType

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour.config import BehaviourConfig
from cosim.traffic.behaviour.events import Event, EventKind
from cosim.traffic.behaviour.roads import Roads
from cosim.traffic.motion import Motion
from cosim.traffic.simulation import Traffic

NEAR_M = 30.0


@dataclass(eq=False)
class Stage:
    """The simulation as drivers meet it.

    Attributes:
        config: how they behave.
        traffic, motion, roads: where.
        actors: smoothed, after the last step.
        rows: vehicle → row of `actors`.
        step_s: SUMO's step length.
        busy: vehicles in a manoeuvre; no other one may start.
        attended: parked vehicles that people are about, which do not drive off.
        exempt: vehicles that neither park nor collide nor are taken away (the ego).
        sight_m: no vehicle may be removed within this distance of one of them.
        share: of the town's drivers, those among `actors`.
        left: who was among `actors` a step before and is no more.
        steered: vehicles whose speed in SUMO a manoeuvre sets.
        pace: speed that others are sent on with [m/s]; who is missing goes as SUMO likes.
        collided: pairs, in alphabetical order, that have collided as drawn.
        events: what has happened.
    """

    config: BehaviourConfig
    traffic: Traffic
    motion: Motion
    roads: Roads
    actors: Actors
    rows: dict[str, int]
    step_s: float
    busy: set[str] = field(default_factory=set)
    attended: set[str] = field(default_factory=set)
    exempt: set[str] = field(default_factory=set)
    sight_m: float = 120.0
    share: float = 1.0
    left: tuple[str, ...] = ()
    steered: set[str] = field(default_factory=set)
    pace: dict[str, float] = field(default_factory=dict)
    collided: set[tuple[str, str]] = field(default_factory=set)
    events: list[Event] = field(default_factory=list)

    @property
    def api(self) -> ModuleType:
        """The running libsumo."""
        return self.traffic.api

    def engaged(self, vehicle: str) -> bool:
        """Return whether a vehicle cannot start a manoeuvre: in one, observed, or a taxi on its way to a passenger."""
        return vehicle in self.busy or vehicle in self.attended or self.traffic.dispatched(vehicle)

    def see(self, actors: Actors) -> None:
        """Go on to the next step."""
        self.left = ()
        if actors.ids != self.actors.ids:
            self.left = tuple(sorted(self.rows.keys() - set(actors.ids)))
            self.rows = {name: row for row, name in enumerate(actors.ids)}
        self.actors = actors

    def record(self, kind: EventKind, *vehicles: str) -> None:
        """Note an event."""
        self.events.append(Event(kind, self.actors.time_s, vehicles))

    def take_away(self, vehicle: str) -> bool:
        """Let a vehicle leave the simulation, unless it is exempt or in sight of one that is; whether it does."""
        if vehicle in self.exempt or self._in_sight(vehicle):
            return False
        self.record("taken_away", vehicle)
        self.traffic.remove(vehicle)
        self.busy.add(vehicle)
        return True

    def _in_sight(self, vehicle: str) -> bool:
        places = self.actors.front[:, :2]
        watchers = [self.rows[name] for name in self.exempt if name in self.rows]
        away = places[watchers] - places[self.rows[vehicle]]
        return bool((np.hypot(away[:, 0], away[:, 1]) < self.sight_m).any())

    def due(self, per_min: float, rng: np.random.Generator) -> bool:
        """Whether an incident of a rate in the whole town falls into this step, and to those among `actors`."""
        return per_min > 0 and bool(rng.random() < per_min / 60 * self.step_s * self.share)

    def boxes_near(self, position: np.ndarray, but: str) -> np.ndarray:
        """Boxes (k, 5) of vehicles near a position (2,) and of people next to them: x, y, heading, length, width.

        Without one vehicle.
        """
        actors = self.actors
        walks = np.array([kind == "pedestrian" for kind in actors.kinds], bool)
        centre = actors.front[:, :2] - actors.to_front(actors.heading_rad)
        near = np.hypot(*(centre - position).T) < NEAR_M
        near &= ~walks | np.array([not lane for lane in actors.lanes], bool)
        if but in self.rows:
            near[self.rows[but]] = False
        return np.column_stack([centre, actors.heading_rad, actors.size[:, :2]])[near]


def in_axes(boxes: np.ndarray, origin: np.ndarray, heading_rad: float) -> np.ndarray:
    """Boxes (k, 5) in axes at `origin` (2,), x along `heading_rad`."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    away = boxes[:, :2] - origin
    turned = np.column_stack([away[:, 0] * cos + away[:, 1] * sin, away[:, 1] * cos - away[:, 0] * sin])
    return np.column_stack([turned, boxes[:, 2] - heading_rad, boxes[:, 3:]])

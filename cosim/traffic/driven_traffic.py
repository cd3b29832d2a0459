"""SUMO, the drivers' behaviour and the motion of their vehicles as one, and which vehicles take part in it."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour import BehaviourConfig, Drivers, Event
from cosim.traffic.behaviour.bystanders import Bystanders
from cosim.traffic.behaviour.kerbside import KerbsideParking
from cosim.traffic.behaviour.roads import Roads
from cosim.traffic.motion import Motion, overlaps
from cosim.traffic.simulation import Traffic

_ENTRY_CLEAR_M = 0.15
_LOOKS_EVERY_S = 0.5
# two who drive towards each other come 15 m nearer between two looks; then some way to settle on
_SIGHT_MARGIN_M = 25.0
_LEAVES_M = 15.0  # beyond that before one is left to SUMO again


class DrivenTraffic:
    """A running simulation whose vehicles behave and move as real ones.

    Args:
        traffic: the simulation, not yet stepped.
        config: how drivers behave.
        seed: of their behaviour.
        sight_m: no vehicle is inserted or removed within this distance of a protected vehicle.
        may_appear: whether vehicles may appear there all the same.
        on_step: called after every step.
        beside_parked: share of the parked vehicles with a person near them [1].
    """

    def __init__(
        self,
        traffic: Traffic,
        config: BehaviourConfig,
        seed: int,
        sight_m: float = 120.0,
        *,
        may_appear: bool = False,
        beside_parked: float = 0.0,
        on_step: Callable[[], None] = lambda: None,
    ) -> None:
        self._on_step = on_step
        self._traffic = traffic
        self._motion = Motion(traffic.step_s)
        self._kerbside = KerbsideParking(config, seed)
        self._roads = Roads(traffic.api)
        self._protected: set[str] = set()
        self._sight_m = sight_m
        self._vicinity: _Vicinity | None = None
        self._entrances = _Admission(traffic, self._motion, self._protected, 0.0 if may_appear else sight_m)
        self._bystanders = Bystanders(beside_parked, seed, self._roads)
        self._drivers = Drivers(config, seed, self._roads, self._protected, sight_m, self._bystanders.cars)

    @property
    def events(self) -> list[Event]:
        """Actions of drivers so far."""
        return self._drivers.events

    def protect(self, vehicle: str) -> None:
        """Exclude a vehicle (the ego) from parking and collisions, and insertions and removals in its view."""
        self._protected.add(vehicle)

    def follow(self, vehicle: str) -> None:
        """Protect a vehicle, and from now on give only those who are near it or act; `everyone` adds the others."""
        self.protect(vehicle)
        self._vicinity = _Vicinity(self._traffic, vehicle, self._sight_m)

    def attend(self, position: np.ndarray) -> None:
        """From now on give only those who are near a place (2,) in the town's axes, or act."""
        self._vicinity = _Vicinity(self._traffic, position, self._sight_m)

    def everyone(self, actors: Actors) -> Actors:
        """The actors of the last step, and after them all whom only SUMO moves."""
        return actors if self._vicinity is None else actors.and_then(self._traffic.distant())

    def advance(self, steps: int) -> Actors:
        """Go on by some steps (at least one).

        Raises:
            TrafficError: SUMO gave up.
        """
        actors = self.step()
        for _ in range(steps - 1):
            actors = self.step()
        return actors

    def step(self) -> Actors:
        """Go on by one step.

        Raises:
            TrafficError: SUMO gave up.
        """
        if self._vicinity is not None:
            self._vicinity.look(self._drivers.acting)
            self._drivers.share = self._vicinity.share
        actors = self._kerbside.arrange(self._traffic, self._roads, self._traffic.step())
        actors = self._bystanders.join(self._traffic, self._motion, actors)
        actors = self._motion.update(self._entrances.admit(actors))
        self._drivers.apply(self._traffic, self._motion, actors)
        self._on_step()
        return actors


class _Admission:
    """Turns away vehicles that SUMO puts where a body is that follows late, or in sight of a watcher.

    Args:
        traffic: where vehicles enter.
        motion: where bodies are.
        watchers: vehicles in whose view no vehicle is inserted.
        sight_m: how far they see.
    """

    def __init__(self, traffic: Traffic, motion: Motion, watchers: set[str], sight_m: float) -> None:
        self._traffic = traffic
        self._motion = motion
        self._watchers = watchers
        self._sight_m = sight_m
        self._known: tuple[str, ...] = ()

    def admit(self, actors: Actors) -> Actors:
        """The actors of a step without those who are turned away; these leave the simulation."""
        if actors.ids == self._known:
            return actors
        before = set(self._known)
        wheeled = [row for row, kind in enumerate(actors.kinds) if kind != "pedestrian"]
        new = [row for row in wheeled if actors.ids[row] not in before and not actors.parked[row]]
        people = [row for row, kind in enumerate(actors.kinds) if kind == "pedestrian" and not actors.lanes[row]]
        away: set[str] = set()
        if new:
            touching = self._touching(actors, np.array([*wheeled, *people]), set(new))
            away = {actors.ids[row] for row in new if row in touching or (before and self._in_sight(actors, row))}
            for vehicle in sorted(away):
                self._traffic.remove(vehicle)
            actors = actors.without(away) if away else actors
        self._known = actors.ids
        return actors

    def _touching(self, actors: Actors, bodies: np.ndarray, new: set[int]) -> set[int]:
        front, heading = self._motion.poses(actors)
        centre = front - actors.to_front(heading)
        found = overlaps(centre[bodies], heading[bodies], actors.size[bodies, :2] + _ENTRY_CLEAR_M)
        pairs = zip(bodies[found.first].tolist(), bodies[found.second].tolist(), strict=True)
        return {j if j in new else i for i, j in pairs if i in new or j in new}

    def _in_sight(self, actors: Actors, row: int) -> bool:
        watchers = [i for i, name in enumerate(actors.ids) if name in self._watchers]
        away = actors.front[watchers, :2] - actors.front[row, :2]
        return bool((np.hypot(away[:, 0], away[:, 1]) < self._sight_m).any())


class _Vicinity:
    """Selects the vehicles to observe twice a second.

    Args:
        traffic: the simulation.
        centre: the vehicle that is followed (the ego), or a place (2,) in the town's axes.
        sight_m: who comes so near has been attended to for a while.

    Attributes:
        share: of all vehicles that drive, those attended to.
    """

    def __init__(self, traffic: Traffic, centre: str | np.ndarray, sight_m: float) -> None:
        self._traffic = traffic
        self._centre = centre
        self._reach_m = sight_m + _SIGHT_MARGIN_M
        self._every_steps = max(1, round(_LOOKS_EVERY_S / traffic.step_s))
        self._steps = 0
        self._near: set[str] = set()
        self.share = 1.0

    def look(self, acting: Collection[str]) -> None:
        """Look round if it is time to, before a step.

        Args:
            acting: vehicles in a manoeuvre: they are attended to wherever they are.
        """
        self._steps += 1
        if (self._steps - 1) % self._every_steps:
            return
        driving, parked, walking, places = self._traffic.places()
        if isinstance(self._centre, str) and self._centre not in driving:
            return
        here = places[driving.index(self._centre)] if isinstance(self._centre, str) else self._centre
        away = np.hypot(*(places - here).T).tolist()
        names = [*driving, *parked, *walking]
        reach_m, stays_m = self._reach_m, self._reach_m + _LEAVES_M
        near = {
            name for name, m in zip(names, away, strict=True) if m < reach_m or (m < stays_m and name in self._near)
        }
        near.update(acting)
        self._near = near
        driven = [name for name in driving if name in near]
        self._traffic.attend(
            driven, [name for name in parked if name in near], [name for name in walking if name in near]
        )
        self.share = len(driven) / max(len(driving), 1)

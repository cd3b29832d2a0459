"""SUMO, the drivers' behaviour and the motion of their vehicles as one."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.admission import Admission
from cosim.traffic.behaviour import BehaviourConfig, Drivers, Event
from cosim.traffic.behaviour.bystanders import Bystanders
from cosim.traffic.behaviour.kerbside import KerbsideParking
from cosim.traffic.behaviour.roads import Roads
from cosim.traffic.motion import Motion
from cosim.traffic.simulation import Traffic
from cosim.traffic.vicinity import Vicinity


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
        angled_parking: ids of parking areas whose vehicles are parked at an angle: SUMO places them.
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
        angled_parking: Collection[str] = (),
        on_step: Callable[[], None] = lambda: None,
    ) -> None:
        self._on_step = on_step
        self._traffic = traffic
        self._motion = Motion(traffic.step_s)
        self._kerbside = KerbsideParking(config, seed)
        self._roads = Roads(traffic.api, angled_parking)
        self._protected: set[str] = set()
        self._sight_m = sight_m
        self._vicinity: Vicinity | None = None
        self._entrances = Admission(traffic, self._motion, self._protected, 0.0 if may_appear else sight_m)
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
        self._vicinity = Vicinity(self._traffic, vehicle, self._sight_m)

    def attend(self, position: np.ndarray) -> None:
        """From now on give only those who are near a place (2,) in the town's axes, or act."""
        self._vicinity = Vicinity(self._traffic, position, self._sight_m)

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

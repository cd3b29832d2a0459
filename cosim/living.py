"""SUMO, the drivers' behaviour and the motion of their vehicles as one."""

from __future__ import annotations

from cosim.actors import Actors
from cosim.behaviour import BehaviourConfig, Drivers, Event
from cosim.motion import Motion
from cosim.traffic import Traffic


class LivingTraffic:
    """A running simulation whose vehicles behave and move as real ones.

    Args:
        traffic: the simulation, not yet stepped.
        config: how drivers behave.
        seed: of their behaviour.
    """

    def __init__(self, traffic: Traffic, config: BehaviourConfig, seed: int) -> None:
        self._traffic = traffic
        self._motion = Motion(traffic.step_s)
        self._drivers = Drivers(config, seed)

    @property
    def events(self) -> list[Event]:
        """What drivers did so far."""
        return self._drivers.events

    def protect(self, vehicle: str) -> None:
        """Let a vehicle neither park nor collide."""
        self._drivers.exempt(vehicle)

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
        actors = self._motion.update(self._traffic.step())
        self._drivers.apply(self._traffic, self._motion, actors)
        return actors

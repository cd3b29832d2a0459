"""All drivers of an episode."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour.collisions import Collisions, Contacts
from cosim.traffic.behaviour.config import BehaviourConfig
from cosim.traffic.behaviour.events import Event
from cosim.traffic.behaviour.free_driving import FreeDriving
from cosim.traffic.behaviour.gridlock import Gridlock
from cosim.traffic.behaviour.lane_changes import LaneChanges
from cosim.traffic.behaviour.patience import Patience
from cosim.traffic.behaviour.pull_in import PullIn
from cosim.traffic.behaviour.pull_out import PullOut
from cosim.traffic.behaviour.roads import Roads
from cosim.traffic.behaviour.routes import Onward
from cosim.traffic.behaviour.stage import Stage
from cosim.traffic.behaviour.u_turns import Turnarounds, UTurns
from cosim.traffic.behaviour.vehicle_parameters import ChangedParameters
from cosim.traffic.motion import Motion
from cosim.traffic.simulation import Traffic


class Drivers:
    """Makes vehicles behave as a configuration says.

    Args:
        config: how.
        seed: seed of all draws; those of a driver's habits depend only on it and on the vehicle's id.
        roads: the network.
        exempt: vehicles (the ego) that neither park nor collide, now or from a later step on.
        attended: parked vehicles that do not drive off, now or from a later step on.
        sight_m: no vehicle is removed within this distance of an exempt vehicle.

    Attributes:
        share: of the town's drivers, those that are given; as large a share of the incidents falls to them.
    """

    def __init__(
        self,
        config: BehaviourConfig,
        seed: int,
        roads: Roads,
        exempt: set[str],
        sight_m: float,
        attended: set[str],
    ) -> None:
        def rng(name: str) -> np.random.Generator:
            return np.random.default_rng([seed, zlib.crc32(name.encode())])

        driving = FreeDriving(seed)
        self._config = config
        self._roads = roads
        self._sight_m = sight_m
        self._behaviours = (
            self._acts_of_sumo(config, seed, rng)
            if config.as_given
            else (
                driving,
                LaneChanges(rng("lane changes"), driving),
                PullOut(rng("pull-outs")),
                PullIn(rng("pull-ins")),
                UTurns(rng("U-turns")),
                Collisions(rng("collisions")),
                Turnarounds(),
                Onward(rng("onward")),
                Gridlock(),
                Patience(),
                Contacts(rng("contacts")),
            )
        )
        self._stage: Stage | None = None
        self._exempt, self._attended = exempt, attended
        self.share = 1.0

    @staticmethod
    def _acts_of_sumo(config: BehaviourConfig, seed: int, rng: Callable[[str], np.random.Generator]) -> tuple:
        """Changes that a configuration makes to the preset `sumo`; usually only that vehicles wait for their bodies."""
        acts: list = [ChangedParameters(config, seed)] if config.changes_vtypes else []
        if config.lane_change_share.bounds != (0.0, 0.0):
            acts.append(LaneChanges(rng("lane changes"), FreeDriving(seed)))
        if config.pull_outs_per_min > 0:
            acts.append(PullOut(rng("pull-outs")))
        if config.u_turns_per_min > 0:
            acts.append(UTurns(rng("U-turns")))
        return (*acts, Patience())

    @property
    def events(self) -> list[Event]:
        """Events so far, in order of time."""
        return [] if self._stage is None else self._stage.events

    @property
    def acting(self) -> set[str]:
        """Vehicles in a manoeuvre, which must be seen to its end."""
        return set() if self._stage is None else self._stage.busy | self._stage.steered

    def apply(self, traffic: Traffic, motion: Motion, actors: Actors) -> None:
        """Act after a step.

        Args:
            traffic: the running simulation.
            motion: that smooths it.
            actors: smoothed, after the step.
        """
        if self._stage is None:
            rows = {name: row for row, name in enumerate(actors.ids)}
            self._stage = Stage(
                self._config,
                traffic,
                motion,
                self._roads,
                actors,
                rows,
                traffic.step_s,
                exempt=self._exempt,
                attended=self._attended,
                sight_m=self._sight_m,
            )
        self._stage.share = self.share
        self._stage.see(actors)
        for behaviour in self._behaviours:
            behaviour.step(self._stage)

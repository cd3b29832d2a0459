"""The model's traffic as trajectories."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cosim.driver_discrepancy.driving import Driving
from cosim.driver_discrepancy.replay import Leaving, Replay
from cosim.driver_discrepancy.settings import DEFAULT
from cosim.driver_discrepancy.tracks import Tracks, gathered
from cosim.traffic.actors import Actors
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.simulation import Traffic

_BY = DEFAULT.simulating


class Recorder:
    """Gathers samples of vehicles; of those who are parked only now and then.

    Args:
        sample_s: time between two samples.
    """

    def __init__(self, sample_s: float) -> None:
        self._sample_s = sample_s
        self._next_s = -np.inf
        self._parked_s: dict[str, float] = {}
        self._ids: list[str] = []
        self._types: list[str] = []
        self._lanes: list[str] = []
        self._rows: list[np.ndarray] = []

    def see(self, actors: Actors) -> None:
        """Look at one step."""
        if actors.time_s < self._next_s - 1e-6:
            return
        first = not np.isfinite(self._next_s)
        self._next_s = (actors.time_s if first else self._next_s) + self._sample_s
        keep = [row for row in range(len(actors)) if actors.kinds[row] != "pedestrian" and self._due(actors, row)]
        self._ids += [actors.ids[row] for row in keep]
        self._types += [actors.types[row] for row in keep]
        self._lanes += [actors.lanes[row] for row in keep]
        time_s = np.full(len(keep), actors.time_s)
        speed, heading = actors.speed_mps[keep], actors.heading_rad[keep]
        self._rows.append(np.column_stack([time_s, actors.front[keep, :2], speed, heading]))

    def tracks(self) -> Tracks:
        """All that was seen."""
        values = np.concatenate(self._rows) if self._rows else np.zeros((0, 5))
        return gathered(self._ids, self._types, self._lanes, values[:, 0], values[:, 1:3], values[:, 3], values[:, 4])

    def _due(self, actors: Actors, row: int) -> bool:
        if not actors.parked[row]:
            self._parked_s.pop(actors.ids[row], None)
            return True
        if actors.time_s < self._parked_s.get(actors.ids[row], -np.inf):
            return False
        self._parked_s[actors.ids[row]] = actors.time_s + _BY.parked_every_s
        return True


def simulate(replay: Replay, behaviour: BehaviourConfig, seed: int, step_s: float) -> Tracks:
    """Let the model drive a measured demand.

    Args:
        replay: the demand.
        behaviour: how drivers behave; equal seeds give each vehicle the same luck whatever the behaviour.
        seed: of SUMO and of all draws.
        step_s: of the simulation.

    Raises:
        TrafficError: SUMO refuses the scenario.
    """
    recorder = Recorder(replay.sample_s)
    with Traffic(replay.sumocfg, seed=seed, step_s=step_s, as_given=behaviour.as_given) as traffic:
        driving, exits = Driving(traffic, behaviour, seed, replay.seconds), _Exits(replay.leaving)
        for _ in range(round(replay.seconds / step_s)):
            actors = traffic.step()
            recorder.see(actors)
            driving.step(actors)
            exits.see(traffic, actors)
    return recorder.tracks()


def record(
    sumocfg: Path, behaviour: BehaviourConfig, *, seed: int, step_s: float, warm_up_s: float, seconds: float
) -> Tracks:
    """Trajectories of a scenario's own demand, a sample a step.

    Raises:
        TrafficError: SUMO refuses the scenario.
    """
    recorder = Recorder(step_s)
    with Traffic(sumocfg, seed=seed, step_s=step_s, as_given=behaviour.as_given) as traffic:
        driving, warm_up = Driving(traffic, behaviour, seed, warm_up_s + seconds), round(warm_up_s / step_s)
        for number in range(warm_up + round(seconds / step_s)):
            actors = traffic.step()
            if number >= warm_up:
                recorder.see(actors)
            driving.step(actors)
    return recorder.tracks()


class _Exits:
    """Lets vehicles leave where they were last measured."""

    def __init__(self, leaving: Mapping[str, Leaving]) -> None:
        self._leaving = dict(leaving)
        self._edge: dict[str, str] = {}
        self._passed: Counter[str] = Counter()

    def see(self, traffic: Traffic, actors: Actors) -> None:
        for row, (name, lane) in enumerate(zip(actors.ids, actors.lanes, strict=True)):
            leaving = self._leaving.get(name)
            if leaving is None or not lane or lane[0] == ":":
                continue
            edge = lane.rpartition("_")[0]
            if self._edge.get(name) != edge:
                self._edge[name] = edge
                self._passed[name] += 1
            there = edge == leaving.edge and self._passed[name] >= leaving.edges
            if there and actors.lane_position_m[row] > leaving.along_m - _BY.passed_m:
                traffic.remove(name)
                del self._leaving[name]

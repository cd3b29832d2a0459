"""Start of an episode: its scenario, and the warm-up of SUMO, which runs next to other work."""

from __future__ import annotations

import contextlib
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Self

import numpy as np

from assets.ranges import draw
from cosim.capture.config import RunConfig
from cosim.capture.plan import EpisodePlan
from cosim.traffic.starting import SavedState
from cosim.traffic.warm_up import WarmUp
from sumo_nets import RECIPES, Town, read_town, write_demand
from sumo_nets.dispatch import with_dispatcher

_LEAD_IN_S = 8.0  # until vehicle bodies and driver behaviour are initialised
_AHEAD = 2  # the present episode and the next
_read_town = lru_cache(maxsize=1)(read_town)  # most consecutive episodes of a process have the same town


@dataclass(frozen=True)
class EpisodeStart:
    """Scenario of a simulation in a temporary folder, with its warm-up; a context manager that deletes the folder.

    Attributes:
        sumocfg: scenario file.
        beside_parked: share of the parked vehicles that have people next to them.
        seed: SUMO's seed.
        rng: random numbers of the simulation, from here on.
        lead_in_s: simulated time between the warm-up and the first frame [s].
        warm_up: running warm-up; None if the simulation starts with an empty network.
        folder: temporary folder.
    """

    sumocfg: Path
    beside_parked: float
    seed: int
    rng: np.random.Generator
    lead_in_s: float
    warm_up: WarmUp | None
    folder: tempfile.TemporaryDirectory

    @classmethod
    def of(cls, plan: EpisodePlan, attempt: int, config: RunConfig, town: Town) -> EpisodeStart:
        """Write the scenario of a simulation of an episode and start its warm-up.

        Raises:
            TownError: the town cannot be populated.
            TrafficError: SUMO cannot be started.
        """
        rng = np.random.default_rng([config.seed, plan.number, attempt])
        # A user's scenario is simulated step by step from its start, because a saved state of SUMO is not complete.
        lead_in_s = min(config.warm_up_s, _LEAD_IN_S) if town.scenario is None else config.warm_up_s
        with contextlib.ExitStack() as cleanup:
            folder = tempfile.TemporaryDirectory(prefix="cosim-")
            cleanup.callback(folder.cleanup)
            path = Path(folder.name)
            sumocfg, beside_parked = populated(town, config, rng, path)
            seed, warm_up = int(rng.integers(2**31)), None
            if config.warm_up_s > lead_in_s:
                warm_up = WarmUp(sumocfg, seed, config.warm_up_s - lead_in_s, path)
            cleanup.pop_all()
        return cls(sumocfg, beside_parked, seed, rng, lead_in_s, warm_up, folder)

    def state(self) -> SavedState | None:
        """Wait for the end of the warm-up; None if there is none.

        Raises:
            TrafficError: SUMO refuses the scenario, or stopped.
        """
        return None if self.warm_up is None else self.warm_up.state()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.warm_up is not None:
            self.warm_up.stop()
        self.folder.cleanup()


class EpisodeStarts:
    """Starts of episodes; those of built-in towns can be prepared ahead.

    Args:
        config: configuration of the run.
    """

    def __init__(self, config: RunConfig) -> None:
        self._config = config
        self._ahead: dict[int, EpisodeStart] = {}

    def prepare(self, plan: EpisodePlan) -> None:
        """Prepare the first simulation of an episode, unless it has a scenario of the user; at most two are kept.

        Raises:
            TrafficError: SUMO cannot be started.
        """
        if plan.number in self._ahead or plan.town not in RECIPES or self._config.trajectories is not None:
            return
        while len(self._ahead) >= _AHEAD:
            self._ahead.pop(next(iter(self._ahead))).__exit__()
        self._ahead[plan.number] = EpisodeStart.of(plan, 0, self._config, _read_town(plan.town))

    def take(self, plan: EpisodePlan, attempt: int, config: RunConfig, town: Town) -> EpisodeStart:
        """The start of a simulation: the prepared one if there is one, otherwise a new one.

        Args:
            plan: plan of the episode.
            attempt: number of the simulation in its episode.
            config: configuration of the simulation, which may have a shorter warm-up than that of the run.
            town: town of the episode.

        Raises:
            TownError: the town cannot be populated.
            TrafficError: SUMO cannot be started.
        """
        return self._ahead.pop(plan.number, None) or EpisodeStart.of(plan, attempt, config, town)

    def close(self) -> None:
        """Stop the warm-ups of episodes that were not taken, and delete their files."""
        while self._ahead:
            self._ahead.popitem()[1].__exit__()


def populated(town: Town, config: RunConfig, rng: np.random.Generator, folder: Path) -> tuple[Path, float]:
    """Write the scenario to simulate: random demand for a built-in town, the user's own scenario otherwise.

    Returns:
        Path of the `.sumocfg` file, and the share of parked vehicles that have people next to them.
    """
    if town.scenario is not None and config.taxi_dispatch is not None:
        return with_dispatcher(town.scenario, config.taxi_dispatch).write(folder), 0.0
    if town.scenario is not None:
        return town.runnable(folder), 0.0
    demand = config.population.draw(RECIPES[town.name].demand, rng)
    share = draw(config.population.beside_parked, rng.spawn(1)[0])
    return write_demand(town, demand, int(rng.integers(2**31)), folder), share

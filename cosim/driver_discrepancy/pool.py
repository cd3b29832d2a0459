"""Simulations of the model side by side, each in a process of its own."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Self

from cosim.driver_discrepancy.conditions import ConditionFrame
from cosim.driver_discrepancy.demand import MeasuredDemand
from cosim.driver_discrepancy.network import Network
from cosim.driver_discrepancy.observation import Observation
from cosim.driver_discrepancy.placed import place
from cosim.driver_discrepancy.simulate import simulate
from cosim.driver_discrepancy.summary import Summary, summarise
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.starting import TrafficError, load_libsumo

Job = tuple[BehaviourConfig, int]
_MOST_WORKERS, _MOST_DEATHS = 8, 3


class Simulations:
    """Runs the model and remembers what came out; a context manager.

    libsumo knows one simulation a process, so workers are spawned.

    Args:
        demand: the demand.
        network: of the town.
        frame: levels of the conditions.
        observation: how positions are measured.
        step_s: of the simulation.
        workers: processes; by default one a core.
    """

    def __init__(
        self,
        demand: MeasuredDemand,
        network: Network,
        frame: ConditionFrame,
        observation: Observation,
        step_s: float,
        workers: int | None = None,
    ) -> None:
        self._workers = workers or min(os.cpu_count() or 1, _MOST_WORKERS)
        self._given = (demand, network, frame, observation, step_s)
        self._pool = self._started()
        self._done: dict[tuple[str, int], Summary] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(wait=True, cancel_futures=True)

    @property
    def count(self) -> int:
        """Number of simulations."""
        return len(self._done)

    def run(self, jobs: Sequence[Job]) -> list[Summary]:
        """Summaries of the model with a behaviour and a seed each, in order.

        SUMO may die of what an earlier simulation left in its process; the rest is then done by fresh ones.

        Raises:
            TrafficError: SUMO refuses the scenario, or dies of it.
        """
        keys, deaths = [(behaviour.model_dump_json(), seed) for behaviour, seed in jobs], 0
        while new := {key: job for key, job in zip(keys, jobs, strict=True) if key not in self._done}:
            before = len(self._done)
            try:
                for key, summary in zip(new, self._pool.map(_summary, new.values()), strict=True):
                    self._done[key] = summary
            except BrokenProcessPool:
                deaths = 1 if len(self._done) > before else deaths + 1
                self._pool.shutdown()
                self._pool = self._started()
                if deaths > _MOST_DEATHS:
                    raise TrafficError(
                        "SUMO dies of a simulation again and again; try another number of --seeds"
                    ) from None
        return [self._done[key] for key in keys]

    def _started(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self._workers, multiprocessing.get_context("spawn"), initializer=_begin, initargs=self._given
        )


class _Worker:
    """Data that a process receives when it starts."""

    given: tuple[MeasuredDemand, Network, ConditionFrame, Observation, float]


def _begin(
    demand: MeasuredDemand, network: Network, frame: ConditionFrame, observation: Observation, step_s: float
) -> None:
    _Worker.given = (demand, network, frame, observation, step_s)


def _summary(job: Job) -> Summary:
    """One simulation; SUMO's own errors cannot pass from process to process, so their words do.

    Raises:
        TrafficError: SUMO refuses.
    """
    libsumo = load_libsumo()

    demand, network, frame, observation, step_s = _Worker.given
    behaviour, seed = job
    try:
        tracks = observation.apply(simulate(demand, behaviour, seed, step_s), seed)
        return summarise(place(tracks, network), frame, demand.clock_s, demand.planned)
    except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
        raise TrafficError(f"SUMO refuses what drivers do: {error}") from None
    except TrafficError as error:
        raise TrafficError(str(error)) from None  # its cause cannot pass between processes

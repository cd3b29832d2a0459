"""One SUMO simulation, from which a stretch of frames is recorded."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cosim.actors import Actors
from cosim.config import RunConfig
from cosim.living import LivingTraffic
from cosim.traffic import Traffic
from sumo_nets import Town


@dataclass(frozen=True)
class EpisodePlan:
    """Which frames of a drive one episode gives.

    Attributes:
        number: from 0.
        frames: their names, in order of time.
    """

    number: int
    frames: tuple[str, ...]


class FrameRecorder(Protocol):
    """What takes a frame."""

    def record(self, name: str, episode: int, actors: Actors, ego: str) -> None:
        """Measure the world at one step and write the frame."""


def plan_episodes(config: RunConfig) -> list[EpisodePlan]:
    """Cut a run into episodes; frame names count through them."""
    names = [f"{number:06d}" for number in range(config.frames)]
    size = config.frames_per_episode
    return [
        EpisodePlan(number, tuple(names[start : start + size]))
        for number, start in enumerate(range(0, config.frames, size))
    ]


def run_episode(
    plan: EpisodePlan,
    config: RunConfig,
    town: Town,
    recorder: FrameRecorder,
    *,
    done: Collection[str],
    on_frame: Callable[[str], None],
) -> None:
    """Simulate an episode and record those of its frames that are not done.

    The traffic of an episode follows from the run's seed and the episode's number alone, so an episode that is
    taken up again after an interruption passes through the same states.

    Raises:
        TrafficError: SUMO refuses the scenario, or the ego vehicle is gone.
    """
    pending = [name for name in plan.frames if name not in done]
    if not pending:
        return
    rng = np.random.default_rng([config.seed, plan.number])
    with Traffic(town.sumocfg, seed=int(rng.integers(2**31)), step_s=config.step_s) as traffic:
        living = LivingTraffic(traffic, config.behaviour, seed=int(rng.integers(2**31)))
        actors = living.advance(max(2, round(config.warm_up_s / config.step_s)))
        ego = traffic.draw_ego(actors, rng)
        living.protect(ego)
        steps = max(1, round(config.record_every_s / config.step_s))
        for name in plan.frames[: plan.frames.index(pending[-1]) + 1]:
            traffic.prolong_route(ego, rng)
            actors = living.advance(steps)
            traffic.demand_present(ego, actors)
            if name in done:
                continue
            recorder.record(name, plan.number, actors, ego)
            on_frame(name)

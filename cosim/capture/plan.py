"""Division of a run into episodes, each with its town, world and frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cosim.capture.config import RunConfig


@dataclass(frozen=True)
class EpisodePlan:
    """Plan of one episode.

    Attributes:
        number: number of the episode, from 0.
        town: name or path of the town.
        world: number of the town's random world.
        frames: names of the frames in temporal order.
    """

    number: int
    town: str
    world: int
    frames: tuple[str, ...]

    def note(
        self, attempt: int, town: str, frames: int, ended: str | None, time_s: float, events: Mapping[str, int]
    ) -> dict[str, object]:
        """Manifest entry of one simulation: name of the town, number of frames, reason and time of its end [s]."""
        return {
            "episode": self.number,
            "attempt": attempt,
            "town": town,
            "world": self.world,
            "frames": frames,
            "ended": ended or "complete",
            "time_s": round(time_s, 6),
            "events": dict(sorted(events.items())),
        }


def plan_episodes(config: RunConfig) -> list[EpisodePlan]:
    """Divide a run into episodes that alternate between the towns; frames are numbered consecutively."""
    names = [f"{number:06d}" for number in range(config.frames)]
    towns = config.towns
    size = min(config.frames_per_episode, -(-config.frames // len(towns)))
    if config.ego is not None:
        size = config.frames  # a given vehicle is followed in a single episode
    starts = range(0, config.frames, size)
    shared = config.episodes_per_world if config.world is None else len(names)  # all episodes use a given world
    return [
        EpisodePlan(
            number=number,
            town=towns[number % len(towns)],
            world=number // len(towns) // shared,
            frames=tuple(names[start : start + size]),
        )
        for number, start in enumerate(starts)
    ]


def world_count(plans: list[EpisodePlan]) -> int:
    """Number of different static worlds in the plan."""
    return len({(plan.town, plan.world) for plan in plans})

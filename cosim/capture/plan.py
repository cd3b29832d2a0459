"""A run cut into episodes: which frames each gives, and where it takes place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cosim.capture.config import RunConfig


@dataclass(frozen=True)
class EpisodePlan:
    """One episode.

    Attributes:
        number: from 0.
        town: name or path of its town.
        world: which of the town's random worlds.
        frames: names of its frames, in order of time.
    """

    number: int
    town: str
    world: int
    frames: tuple[str, ...]

    def note(
        self, attempt: int, town: str, frames: int, ended: str | None, time_s: float, events: Mapping[str, int]
    ) -> dict[str, object]:
        """What the manifest says of one ride: its town's name, how many frames it gave, and why and when it ended."""
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
    """Episodes of a run, towns taking turns; frame names count through them."""
    names = [f"{number:06d}" for number in range(config.frames)]
    towns = config.towns
    size = min(config.frames_per_episode, -(-config.frames // len(towns)))
    if config.ego is not None:
        size = config.frames  # one ride in one vehicle
    starts = range(0, config.frames, size)
    shared = config.episodes_per_world if config.world is None else len(names)  # a given world is what it is
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
    """How many different static worlds the episodes take place in."""
    return len({(plan.town, plan.world) for plan in plans})

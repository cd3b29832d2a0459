"""A run cut into episodes: which frames each gives, and where it takes place."""

from __future__ import annotations

from dataclasses import dataclass

from cosim.config import RunConfig


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


def plan_episodes(config: RunConfig) -> list[EpisodePlan]:
    """Episodes of a run, towns taking turns; frame names count through them."""
    names = [f"{number:06d}" for number in range(config.frames)]
    towns = config.towns
    size = min(config.frames_per_episode, -(-config.frames // len(towns)))
    return [
        EpisodePlan(
            number=number,
            town=towns[number % len(towns)],
            world=number // len(towns) // config.episodes_per_world,
            frames=tuple(names[start : start + size]),
        )
        for number, start in enumerate(range(0, config.frames, size))
    ]


def world_count(plans: list[EpisodePlan]) -> int:
    """How many different static worlds the episodes take place in."""
    return len({(plan.town, plan.world) for plan in plans})

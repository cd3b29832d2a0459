"""Recording as work for processes: the town is built once, then episodes come one after the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

from cosim.capture.config import RunConfig
from cosim.capture.episode import run_episode
from cosim.capture.plan import EpisodePlan
from cosim.capture.replayed import replay_episode, replay_of
from cosim.drives.lock import shared
from cosim.drives.writer import DriveWriter
from cosim.engine import Do, Event, Tell

_TELLS_S = 20.0


class Told(TypedDict):
    """What an episode is told of its frames."""

    done: frozenset[str]
    on_frame: Callable[[str], None]


def _signs_of_life(tell: Tell) -> Callable[[], None]:
    """Tells now and then that the process is at work: large towns take minutes until their first frame."""
    told_s = time.monotonic()

    def step() -> None:
        nonlocal told_s
        if time.monotonic() - told_s > _TELLS_S:
            told_s = time.monotonic()
            tell(Event("alive"))

    return step


@dataclass(frozen=True)
class Recording:
    """A task: an episode, and those of its frames that are there already."""

    plan: EpisodePlan
    done: frozenset[str]

    @property
    def place(self) -> tuple[str, int]:
        """A town's groundwork is the dearest to make, then a world in it."""
        return self.plan.town, self.plan.world


@dataclass(frozen=True)
class RecordJob:
    """What processes record, and where."""

    config: RunConfig
    folder: Path

    @contextmanager
    def open(self, threads: int) -> Iterator[Do]:
        """A rig that records `Recording`s."""
        from cosim.capture.recorder import Recorder
        from cosim.capture.rig_sensors import rig_sensors

        with shared(self.folder):
            replay = None
            recorder = Recorder(self.config, rig_sensors(self.config), DriveWriter(self.folder), threads=threads)

            def record(task: Recording, tell: Tell) -> None:
                nonlocal replay
                town = recorder.move_to(task.plan)
                if replay is None and self.config.trajectories is not None:
                    replay = replay_of(self.config.trajectories, town)
                tell(Event("ready"))
                told: Told = {"done": task.done, "on_frame": lambda name: tell(Event("frame", name))}
                if replay is not None:
                    replay_episode(task.plan, self.config, town, replay, recorder, **told)
                else:
                    run_episode(task.plan, self.config, town, recorder, **told, on_step=_signs_of_life(tell))

            try:
                yield record
            finally:
                recorder.close()

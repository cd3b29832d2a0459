"""Job of the recording processes: build a town once, then record its episodes one after the other."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self, TypedDict

from cosim.capture.config import RunConfig
from cosim.capture.episode import run_episode
from cosim.capture.episode_start import EpisodeStarts
from cosim.capture.plan import EpisodePlan
from cosim.capture.replayed import replay_episode, replay_of
from cosim.drives.lock import shared
from cosim.drives.writer import DriveWriter
from cosim.engine import Do, JobEvent, Tell

_HEARTBEAT_S = 20.0


class _FrameArguments(TypedDict):
    """Arguments of an episode that concern its frames."""

    done: frozenset[str]
    on_frame: Callable[[str], None]


def _make_heartbeat(tell: Tell) -> Callable[[], None]:
    """Return a function that reports at intervals that the process works: a large town's first frame takes minutes."""
    sent_s = time.monotonic()

    def step() -> None:
        nonlocal sent_s
        if time.monotonic() - sent_s > _HEARTBEAT_S:
            sent_s = time.monotonic()
            tell(JobEvent("alive"))

    return step


@dataclass(frozen=True)
class EpisodeRecording:
    """Task of recording an episode.

    Attributes:
        plan: plan of the episode.
        done: names of its frames that exist already.
        upcoming: plan of the episode that the process probably records next.
    """

    plan: EpisodePlan
    done: frozenset[str]
    upcoming: EpisodePlan | None = None

    @property
    def affinity(self) -> tuple[str, int]:
        """Town and world: a process that has them in memory starts the task faster."""
        return self.plan.town, self.plan.world

    def followed_by(self, other: Self) -> EpisodeRecording:
        """The same task with the knowledge of the one that the process probably gets next."""
        return replace(self, upcoming=other.plan)


@dataclass(frozen=True)
class RecordJob:
    """Configuration and folder of the drive that the processes record."""

    config: RunConfig
    folder: Path

    @contextmanager
    def open(self, threads: int) -> Iterator[Do]:
        """Create a recorder; yields a function that records an `EpisodeRecording`."""
        from cosim.capture.recorder import Recorder
        from cosim.capture.rig_sensors import rig_sensors
        from cosim.capture.route_recorder import RouteRecorder

        with shared(self.folder), closing(EpisodeStarts(self.config)) as starts:
            replay = None
            recorder = Recorder(self.config, rig_sensors(self.config), DriveWriter(self.folder), threads=threads)

            def record(task: EpisodeRecording, tell: Tell) -> None:
                nonlocal replay
                starts.prepare(task.plan)  # SUMO warms up while the world is built
                town = recorder.move_to(task.plan)
                if replay is None and self.config.trajectories is not None:
                    replay = replay_of(self.config.trajectories, town)
                tell(JobEvent("ready"))
                target: Recorder | RouteRecorder = recorder
                frames: _FrameArguments = {"done": task.done, "on_frame": lambda name: tell(JobEvent("frame", name))}
                if recorder.follows_route:
                    target = RouteRecorder(recorder, task.plan, **frames)
                    frames = {"done": frozenset(), "on_frame": lambda _: None}
                if replay is not None:
                    replay_episode(task.plan, self.config, town, replay, target, **frames)
                else:
                    if task.upcoming is not None:
                        starts.prepare(task.upcoming)
                    heartbeat = _make_heartbeat(tell)
                    run_episode(task.plan, self.config, town, target, **frames, on_step=heartbeat, starts=starts)

            try:
                yield record
            finally:
                recorder.close()

"""One episode of replayed trajectories."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import nullcontext
from pathlib import Path

import numpy as np

from cosim.capture.collection import StillWatch, Watch
from cosim.capture.config import RunConfig
from cosim.capture.episode import FrameRecorder
from cosim.capture.mast import Mast, stand_mast
from cosim.capture.plan import EpisodePlan
from cosim.traffic.actors import Actors
from cosim.traffic.signals import SignalClock
from cosim.traffic.trajectories import Replay, TrajectoryError, read_trajectories
from sumo_nets import Town

_DRIVES_MPS = 1.0
_SETTLES_S = 0.2  # the first samples of a track tell no acceleration


def replay_of(path: Path, town: Town) -> Replay:
    """The trajectories of a file in a town.

    Raises:
        TrajectoryError: they cannot be replayed.
        TownError: they or the town's files are no safe, whole XML.
    """
    return Replay(read_trajectories(path, town.streets, town.type_files))


def signal_notes(replay: Replay, town: Town) -> tuple[str, ...]:
    """What a user should know of the signals of a replay, a line each.

    Raises:
        TrafficError: SUMO refuses the town's signal programs, or another simulation runs in this process.
    """
    with _signals(replay, town) as signals:
        unknown = () if signals is None else signals.unknown
    if not unknown:
        return ()
    names = ", ".join(unknown[:5]) + (", …" if len(unknown) > 5 else "")
    return (f"{town.name}: {len(unknown)} signals stay dark, as they look at traffic and no time tells them: {names}",)


def replay_episode(
    plan: EpisodePlan,
    config: RunConfig,
    town: Town,
    replay: Replay,
    recorder: FrameRecorder,
    *,
    done: Collection[str],
    on_frame: Callable[[str], None],
) -> None:
    """Record an episode's frames from vehicles of the trajectories, or from a mast, one attempt after the other.

    Raises:
        TrajectoryError: nothing can carry the sensors.
    """
    left = list(plan.frames)
    with _signals(replay, town) as signals:
        for attempt in range(config.collection.attempts if config.ego is None else 1):
            left = _attempt(plan, attempt, left, config, town, replay, signals, recorder, done, on_frame)
            if not left:
                return


def _signals(replay: Replay, town: Town) -> SignalClock | nullcontext[None]:
    """What signals show; nothing where the times of the trajectories are not SUMO's."""
    if not replay.tracks.sumo_clock:
        return nullcontext()
    return SignalClock(town, float(np.floor(replay.tracks.time_s.min())))


def _attempt(
    plan: EpisodePlan,
    attempt: int,
    frames: list[str],
    config: RunConfig,
    town: Town,
    replay: Replay,
    signals: SignalClock | None,
    recorder: FrameRecorder,
    done: Collection[str],
    on_frame: Callable[[str], None],
) -> list[str]:
    """One ride; gives the names of the frames it did not come to."""
    rng = np.random.default_rng([config.seed, plan.number, attempt])
    left, every_s = list(frames), config.collection.every_s
    carrier, time_s, end_s = _carrier(config, town, replay, len(frames) * every_s, rng)
    watch = _watch(config, replay.at(time_s), carrier)
    reason = None
    while left and reason is None:
        time_s = round(time_s + every_s, 6)
        if time_s > end_s:
            reason = "the trajectories end"
            break
        actors = replay.at(time_s)
        reason = watch.end_reason(actors)
        if reason is None and watch.wants(actors):
            name = left.pop(0)
            if name not in done:
                recorder.record(name, plan, actors, carrier, {} if signals is None else signals.at(time_s))
                on_frame(name)
    recorder.note(plan.note(attempt, town.name, len(frames) - len(left), reason, time_s, {}))
    return left


def _carrier(
    config: RunConfig, town: Town, replay: Replay, needed_s: float, rng: np.random.Generator
) -> tuple[str | Mast, float, float]:
    """What carries the sensors, and from when to when."""
    times = replay.tracks.time_s
    if config.rig_used.carrier == "mast":
        driven = replay.tracks.front[replay.tracks.speed_mps > _DRIVES_MPS, :2]
        mast = stand_mast(town.streets, config.mast, driven, rng)
        return mast, float(times.min()), float(times.max())
    ego = replay.draw_ego(config.ego, needed_s, rng)
    start_s, end_s = replay.life(ego)
    if end_s - start_s < config.collection.every_s + _SETTLES_S:
        raise TrajectoryError(
            f"ego {ego!r} is there for {end_s - start_s:g} s only; lower collection.every_s "
            f"({config.collection.every_s:g} s), or name another `ego`"
        )
    return ego, start_s + _SETTLES_S, end_s


def _watch(config: RunConfig, actors: Actors, carrier: str | Mast) -> Watch | StillWatch:
    if isinstance(carrier, Mast):
        return StillWatch(config.collection, actors.time_s, np.array([carrier.x_m, carrier.y_m]), carrier.heading_rad)
    return Watch(config.collection, actors, carrier, 0.0)

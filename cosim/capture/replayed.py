"""Record an episode from replayed trajectories."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import nullcontext
from pathlib import Path

import numpy as np

from cosim.capture.collection import FrameSelector, StationaryFrameSelector
from cosim.capture.config import RunConfig
from cosim.capture.episode import FrameRecorder
from cosim.capture.mast import Mast, choose_mast
from cosim.capture.plan import EpisodePlan
from cosim.traffic.actors import Actors
from cosim.traffic.signals import SignalClock
from cosim.traffic.trajectories import Replay, TrajectoryError, read_trajectories
from sumo_nets import Town

_DRIVING_MPS = 1.0
_SKIPPED_S = 0.2  # the first samples of a track have no acceleration


def replay_of(path: Path, town: Town) -> Replay:
    """Read trajectories from a file for replay in a town.

    Raises:
        TrajectoryError: the trajectories cannot be replayed.
        TownError: the file or a file of the town is not well-formed, safe XML.
    """
    return Replay(read_trajectories(path, town.streets, town.type_files))


def signal_notes(replay: Replay, town: Town) -> tuple[str, ...]:
    """Warnings about the traffic signals of a replay, one line each.

    Raises:
        TrafficError: SUMO refuses the town's signal programs, or another simulation runs in this process.
    """
    with _signals(replay, town) as signals:
        actuated = () if signals is None else signals.unknown
    if not actuated:
        return ()
    names = ", ".join(actuated[:5]) + (", …" if len(actuated) > 5 else "")
    return (
        f"{town.name}: {len(actuated)} signals stay dark because their phases depend on traffic, not only on time: "
        f"{names}",
    )


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
    """Record an episode's frames from vehicles of the trajectories, or from a mast, in one or more attempts.

    Raises:
        TrajectoryError: no vehicle can carry the sensors.
    """
    remaining = list(plan.frames)
    with _signals(replay, town) as signals:
        for attempt in range(config.collection.attempts if config.ego is None else 1):
            remaining = _record_attempt(
                plan, attempt, remaining, config, town, replay, signals, recorder, done, on_frame
            )
            if not remaining:
                return


def _signals(replay: Replay, town: Town) -> SignalClock | nullcontext[None]:
    """Signal states over time; None if the trajectories do not use SUMO's simulation time."""
    if not replay.tracks.sumo_clock:
        return nullcontext()
    return SignalClock(town, float(np.floor(replay.tracks.time_s.min())))


def _record_attempt(
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
    """Record frames from one carrier; return the names of the frames that it did not reach."""
    rng = np.random.default_rng([config.seed, plan.number, attempt])
    remaining, every_s = list(frames), config.collection.every_s
    carrier, time_s, end_s = _choose_carrier(config, town, replay, len(frames) * every_s, rng)
    selector = _make_selector(config, replay.at(time_s), carrier)
    reason = None
    while remaining and reason is None:
        time_s = round(time_s + every_s, 6)
        if time_s > end_s:
            reason = "the trajectories end"
            break
        actors = replay.at(time_s)
        reason = selector.end_reason(actors)
        if reason is None and selector.selects(actors):
            name = remaining.pop(0)
            if name not in done:
                recorder.record(name, plan, actors, carrier, {} if signals is None else signals.at(time_s))
                on_frame(name)
    recorder.note(plan.note(attempt, town.name, len(frames) - len(remaining), reason, time_s, {}))
    return remaining


def _choose_carrier(
    config: RunConfig, town: Town, replay: Replay, needed_s: float, rng: np.random.Generator
) -> tuple[str | Mast, float, float]:
    """Choose the carrier of the sensors; returns it with the start and end of its time in the trajectories [s]."""
    times = replay.tracks.time_s
    if config.rig_used.carrier == "mast":
        driven = replay.tracks.front[replay.tracks.speed_mps > _DRIVING_MPS, :2]
        mast = choose_mast(town.streets, config.mast, driven, rng)
        return mast, float(times.min()), float(times.max())
    ego = replay.draw_ego(config.ego, needed_s, rng)
    start_s, end_s = replay.life(ego)
    if end_s - start_s < config.collection.every_s + _SKIPPED_S:
        raise TrajectoryError(
            f"ego {ego!r} is present for {end_s - start_s:g} s only; lower collection.every_s "
            f"({config.collection.every_s:g} s), or name another `ego`"
        )
    return ego, start_s + _SKIPPED_S, end_s


def _make_selector(config: RunConfig, actors: Actors, carrier: str | Mast) -> FrameSelector | StationaryFrameSelector:
    if isinstance(carrier, Mast):
        return StationaryFrameSelector(
            config.collection, actors.time_s, np.array([carrier.x_m, carrier.y_m]), carrier.heading_rad
        )
    return FrameSelector(config.collection, actors, carrier, 0.0)

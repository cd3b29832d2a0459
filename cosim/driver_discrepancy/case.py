"""A measurement and the model it is held against, ready to be simulated."""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.capture.config import RunConfig, load_config
from cosim.driver_discrepancy.behaviours import Background, with_common_luck
from cosim.driver_discrepancy.network import read_network
from cosim.driver_discrepancy.placed import Placed, place
from cosim.driver_discrepancy.pool import Simulations
from cosim.driver_discrepancy.replay import Replay, route_files, write_replay
from cosim.driver_discrepancy.settings import DEFAULT, TrafficSettings
from cosim.driver_discrepancy.summary import Summary, summarise
from cosim.driver_discrepancy.tracks import TrackError, Tracks, read_tracks, with_true_headings
from cosim.traffic.behaviour import BehaviourConfig
from sumo_nets import read_town


@dataclass(frozen=True, eq=False)
class Case:
    """Everything that a comparison or a diagnosis needs.

    Attributes:
        measured: summary of the measured trajectories.
        behaviour: of the model, ready for common random numbers.
        simulations: of the model.
        background: what the configuration leaves to the town.
        replay: the demand.
        fitted, judging: ids of the vehicles that are fitted, and of those that judge.
        notes: what is worth knowing, a sentence each.
    """

    measured: Summary
    behaviour: BehaviourConfig
    simulations: Simulations
    background: Background
    replay: Replay
    fitted: frozenset[str]
    judging: frozenset[str]
    notes: tuple[str, ...]


@contextmanager
def opened(
    measured: Tracks | str | Path,
    config: RunConfig | str | Path,
    workers: int | None,
    by: TrafficSettings = DEFAULT,
) -> Iterator[Case]:
    """Read a measurement and make its town and demand ready; ends all processes at the end.

    Raises:
        TrackError: the trajectories cannot be used, or are not of this town.
        ConfigError, TownError: the configuration or its town breaks the rules.
    """
    settings = config if isinstance(config, RunConfig) else load_config(Path(config))
    tracks = measured if isinstance(measured, Tracks) else read_tracks(Path(measured))
    tracks, notes = _thinned(with_true_headings(tracks), settings.step_s)
    if tracks.seconds < by.shortest_s:
        raise TrackError(
            f"the trajectories last {tracks.seconds:.1f} s; give at least {by.shortest_s:.0f} s of traffic"
        )
    if len(settings.towns) > 1:
        notes.append(f"the configuration names {len(settings.towns)} towns: the first is taken")
    town = read_town(next(iter(settings.towns)))
    placed = place(tracks, read_network(town.net, town.additional, route_files(town)))
    with tempfile.TemporaryDirectory(prefix="cosim-traffic-") as folder:
        replay = write_replay(placed, town, Path(folder))
        with Simulations(replay, placed.network, settings.step_s, workers) as simulations:
            fitted, judging = _split(placed, by.judge_every)
            yield Case(
                measured=summarise(placed),
                behaviour=with_common_luck(settings.behaviour),
                simulations=simulations,
                background=_background(placed, settings.step_s),
                replay=replay,
                fitted=fitted,
                judging=judging,
                notes=(*notes, *_notes(placed, replay)),
            )


def _thinned(tracks: Tracks, step_s: float) -> tuple[Tracks, list[str]]:
    """At most one sample a step of the simulation."""
    if tracks.step_s > 0.95 * step_s:
        return tracks, []
    tick = np.floor((tracks.time_s - tracks.start_s) / step_s + 1e-6)
    new = np.concatenate([[True], (np.diff(tick) > 0) | (np.diff(tracks.vehicle) != 0)])
    parts = ("vehicle", "time_s", "place", "speed_mps", "heading_rad", "lane")
    thin = replace(tracks, **{name: getattr(tracks, name)[new] for name in parts})
    return thin, [f"samples every {tracks.step_s:.3g} s were thinned to the simulation's step of {step_s:g} s"]


def _split(placed: Placed, judge_every: int) -> tuple[frozenset[str], frozenset[str]]:
    """Vehicles that are fitted and that judge, drivers and parkers alike; drawn by their names."""
    tracks = placed.tracks
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids)))
    judging: set[str] = set()
    for parked in (True, False):
        mine = [name for name, row in zip(tracks.ids, first.tolist(), strict=True) if placed.parked[row] == parked]
        mine.sort(key=lambda name: zlib.crc32(name.encode()))
        judging.update(mine[judge_every - 1 :: judge_every])
    return frozenset(tracks.ids) - judging, frozenset(judging)


def _background(placed: Placed, step_s: float) -> Background:
    types = placed.network.types
    sigma = [types[name].sigma for name in placed.tracks.types if name in types]
    return Background(sigma=float(np.mean(sigma)) if sigma else 0.5, step_s=step_s)


def _notes(placed: Placed, replay: Replay) -> list[str]:
    said = []
    unknown = sorted({name for name in placed.tracks.types if name not in placed.network.types})
    if unknown:
        said.append(
            f"types {', '.join(unknown[:3])}{' …' if len(unknown) > 3 else ''} are none of the town's vTypes: "
            "a usual vehicle of that kind drives in their place, so gaps hang on its length"
        )
    if placed.tracks.step_s > 0.5:
        said.append(
            f"samples every {placed.tracks.step_s:.3g} s: reaction time and imperfection show from 0.2 s or less on"
        )
    if not replay.vehicles[1]:
        said.append("nobody begins parked: pull-outs cannot be told")
    return said

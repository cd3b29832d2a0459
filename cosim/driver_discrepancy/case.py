"""A measurement and the model that is compared with it, ready to be simulated."""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.capture.config import RunConfig, load_config
from cosim.driver_discrepancy.behaviours import Background, with_common_luck
from cosim.driver_discrepancy.conditions import ConditionFrame, choose_frame
from cosim.driver_discrepancy.demand import MeasuredDemand, own_speed_factor, read_demand, route_files
from cosim.driver_discrepancy.lane_use import changes_of_lane
from cosim.driver_discrepancy.matching import match_lanes
from cosim.driver_discrepancy.network import Network, read_network
from cosim.driver_discrepancy.observation import Observation, estimate_observation, resample
from cosim.driver_discrepancy.placed import Placed, place
from cosim.driver_discrepancy.pool import Simulations
from cosim.driver_discrepancy.settings import DEFAULT, TrafficSettings
from cosim.driver_discrepancy.signals import estimate_phases
from cosim.driver_discrepancy.summary import Summary, centres_of, summarise
from cosim.driver_discrepancy.table import read_measured
from cosim.driver_discrepancy.track_checks import check_duration, split_tracks
from cosim.driver_discrepancy.tracks import Tracks, with_true_headings
from cosim.traffic.behaviour import BehaviourConfig
from sumo_nets import Town, read_town


@dataclass(frozen=True, eq=False)
class Case:
    """Inputs of a comparison or a diagnosis.

    Attributes:
        measured: summary of the measured trajectories.
        behaviour: of the model, ready for common random numbers.
        simulations: of the model.
        background: what the configuration leaves to the town.
        demand: the measured demand.
        frame: levels of the conditions.
        fitted, held_out: ids of the vehicles that take part in fits, and of those that are held out.
        notes: limits of the data, a sentence each.
    """

    measured: Summary
    behaviour: BehaviourConfig
    simulations: Simulations
    background: Background
    demand: MeasuredDemand
    frame: ConditionFrame
    fitted: frozenset[str]
    held_out: frozenset[str]
    notes: tuple[str, ...]


@contextmanager
def open_case(
    measured: Tracks | str | Path,
    config: RunConfig | str | Path,
    workers: int | None,
    by: TrafficSettings = DEFAULT,
    vtypes: Sequence[Path] = (),
) -> Iterator[Case]:
    """Read a measurement and make its town and demand ready; ends all processes at the end.

    Args:
        measured: trajectories, or their file.
        config: the model.
        workers: processes; one a core by default.
        by: numbers that decide.
        vtypes: SUMO files with further vehicle types (`.rou.xml` or additional files).

    Raises:
        TrackError: the trajectories cannot be used, or are not of this town.
        ConfigError, TownError: the configuration or its town breaks the rules.
    """
    settings = config if isinstance(config, RunConfig) else load_config(Path(config))
    town = read_town(next(iter(settings.towns)))
    network = read_network(town.net, town.additional, (*route_files(town), *vtypes))
    tracks = measured if isinstance(measured, Tracks) else read_measured(Path(measured), town, vtypes)
    tracks, notes = split_tracks(with_true_headings(tracks))
    check_duration(tracks, by)
    tracks, thinned = resample(tracks, settings.step_s)
    notes = [*tracks.notes, *notes, *thinned]
    if len(settings.towns) > 1:
        notes.append(f"the configuration names {len(settings.towns)} towns: the first is taken")
    tracks, matched = match_lanes(tracks, network)
    placed = place(tracks, network)
    observation = estimate_observation(placed)
    notes += _observation_notes(observation)
    lateral_m = _lateral_resolution(placed, town, by)  # before smoothing, which hides that lanes are changed at once
    placed = place(observation.process(tracks), network)
    phases = estimate_phases(placed)
    frame = choose_frame(placed, phases, centres_of(placed, phases.red(placed)))
    with tempfile.TemporaryDirectory(prefix="cosim-traffic-") as folder:
        demand = read_demand(placed, town, phases, lateral_m, Path(folder))
        with Simulations(demand, network, frame, observation, settings.step_s, workers) as simulations:
            fitted, held_out = _split(placed, by.judge_every)
            yield Case(
                measured=summarise(placed, frame),
                behaviour=with_common_luck(settings.behaviour),
                simulations=simulations,
                background=_background(placed, settings.step_s),
                demand=demand,
                frame=frame,
                fitted=fitted,
                held_out=held_out,
                notes=(*notes, *matched, *phases.notes, *_notes(placed, demand)),
            )


def _observation_notes(observation: Observation) -> list[str]:
    notes = []
    if observation.derives_speed:
        notes.append("speeds are not measured: they are derived from the positions, of simulated vehicles as well")
    if observation.noise_m > 0:
        noise = f"positions have a noise of {observation.noise_m:.2g} m"
        notes.append(f"{noise}: they are smoothed, and simulated positions get the same noise and smoothing")
    return notes


def _split(placed: Placed, judge_every: int) -> tuple[frozenset[str], frozenset[str]]:
    """Split vehicles into fitted and held-out ones by a hash of the name; drivers and parked vehicles separately."""
    tracks = placed.tracks
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids)))
    held_out: set[str] = set()
    for parked in (True, False):
        names = [name for name, row in zip(tracks.ids, first.tolist(), strict=True) if placed.parked[row] == parked]
        names.sort(key=lambda name: zlib.crc32(name.encode()))
        held_out.update(names[judge_every - 1 :: judge_every])
    return frozenset(tracks.ids) - held_out, frozenset(held_out)


def _lateral_resolution(placed: Placed, town: Town, by: TrafficSettings) -> float:
    """The scenario's own lateral resolution, or that with which changes of lane take as long as measured."""
    if town.scenario is not None and "lateral-resolution" in town.scenario.options:
        return float(town.scenario.options["lateral-resolution"])
    rows = changes_of_lane(placed)
    if len(rows) < 3 or placed.tracks.step_s > 1:
        return 0.0
    move = placed.tracks.place[rows + 1] - placed.tracks.place[rows]
    heading = placed.tracks.heading_rad[rows]
    sideways = np.abs(move[:, 1] * np.cos(heading) - move[:, 0] * np.sin(heading))
    at_once = float((sideways > by.simulating.jump_m).mean())
    return 0.0 if at_once > 0.5 else by.simulating.sublane_m


def _background(placed: Placed, step_s: float) -> Background:
    """Means of SUMO's parameters over the drivers' vehicle types, with SUMO's defaults."""
    usual = Background(step_s=step_s)
    keys = {
        "sigma": "sigma",
        "accel": "accel_mps2",
        "decel": "decel_mps2",
        "minGap": "min_gap_m",
        "tau": "tau_s",
        "startupDelay": "startup_delay_s",
        "jmTimegapMinor": "time_gap_s",
    }
    types = placed.network.types
    known = [types[name].attributes for name in placed.tracks.types if name in types]
    known = known or [one.attributes for one in types.values() if one.kind == "car"] or [{}]
    means = {
        field: float(np.mean([float(one.get(key, getattr(usual, field))) for one in known]))
        for key, field in keys.items()
    }
    factors = np.array([own_speed_factor(one) for one in known])
    return replace(usual, **means, speed_factor=float(factors[:, 0].mean()), speed_dev=float(factors[:, 1].mean()))


def _notes(placed: Placed, demand: MeasuredDemand) -> list[str]:
    found = []
    known: Network = placed.network
    unknown = sorted({name for name in placed.tracks.types if name not in known.types})
    if unknown:
        found.append(
            f"types {', '.join(unknown[:3])}{' …' if len(unknown) > 3 else ''} are none of the town's vTypes: "
            "a usual vehicle of that kind is simulated, so gaps depend on its length"
        )
    if placed.tracks.step_s > 0.5:
        found.append(f"samples every {placed.tracks.step_s:.3g} s: reaction time and imperfection need 0.2 s or less")
    if not demand.vehicles[1]:
        found.append("no vehicle is parked at the start: pull-outs cannot be estimated")
    return found

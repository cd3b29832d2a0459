"""Trajectories of the model: SUMO's own driver models with the parameters of a behaviour only."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim.driver_discrepancy.demand import MeasuredDemand, write_demand
from cosim.driver_discrepancy.driving import Driving, needs_steps
from cosim.driver_discrepancy.fcd import ATTRIBUTES, read_fcd
from cosim.driver_discrepancy.settings import DEFAULT
from cosim.driver_discrepancy.tracks import Tracks, gathered, take_rows
from cosim.traffic.actors import Actors
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.behaviour.habits import draw_habits
from cosim.traffic.lane_limits import scale_limits, slow_for_bends
from cosim.traffic.simulation import Traffic
from cosim.traffic.starting import TrafficError, start_sumo_with

_PARKED_FROM_S = 0.8
_BY = DEFAULT.simulating


def simulate(demand: MeasuredDemand, behaviour: BehaviourConfig, seed: int, step_s: float) -> Tracks:
    """Let the model drive a measured demand.

    Vehicles do what SUMO makes of their vTypes; lanes keep their limits in bends unless the behaviour has
    `cornering_mps2`. Lateral positions in the lane are added afterwards unless the sublane model is used.

    Args:
        demand: the demand.
        behaviour: how drivers behave; equal seeds give each vehicle the same draws whatever the behaviour.
        seed: of SUMO and of all draws.
        step_s: of the simulation.

    Raises:
        TrafficError: SUMO refuses the scenario.
    """
    with tempfile.TemporaryDirectory(prefix="cosim-traffic-") as name:
        folder = Path(name)
        options = write_demand(demand, behaviour, seed, step_s, folder)
        output = folder / "fcd.parquet"
        command = [
            *options,
            *("--seed", str(seed % 2**31)),
            *("--step-length", str(step_s)),
            *("--begin", f"{demand.begin_s:.3f}"),
            *("--time-to-teleport", "-1"),
            *("--fcd-output", str(output)),
            *("--fcd-output.attributes", ",".join(ATTRIBUTES)),
            "--fcd-output.skip-empty",
            *(word for key, value in demand.options.items() for word in (f"--{key}", value)),
        ]
        if demand.sample_s > 1.5 * step_s:
            command += ["--device.fcd.period", f"{round(demand.sample_s / step_s) * step_s:.3f}"]
        if demand.lateral_m > 0:
            command += ["--lateral-resolution", str(demand.lateral_m)]
        _run(command, demand, behaviour, seed, step_s)
        tracks = _as_far_as_measured(_without_parking(read_fcd(output), demand), demand)
    if demand.lateral_m == 0:
        tracks = _offset_from_centre(tracks, behaviour, seed)
    types = {trip.name: trip.base[0] for trip in demand.trips}
    return replace(tracks, types=tuple(types[name] for name in tracks.ids))


def _run(command: list[str], demand: MeasuredDemand, behaviour: BehaviourConfig, seed: int, step_s: float) -> None:
    sumo = start_sumo_with(command)
    try:
        if behaviour.cornering_mps2 is not None:
            slow_for_bends(sumo, behaviour.cornering_mps2)
        if behaviour.street_speed is not None:
            scale_limits(sumo, behaviour.street_speed)
        steps = round(demand.seconds / step_s) + 1
        if needs_steps(behaviour):
            driving = Driving(sumo, behaviour, seed, demand.seconds, step_s, sets_parameters=False)
            for _ in range(steps):
                sumo.simulationStep()
                driving.step()
        else:
            sumo.simulationStep(demand.begin_s + steps * step_s)
    except (sumo.TraCIException, sumo.FatalTraCIError) as error:
        raise TrafficError(f"SUMO stopped at {sumo.simulation.getTime():.1f} s: {error}") from None
    finally:
        sumo.close()


def _without_parking(tracks: Tracks, demand: MeasuredDemand) -> Tracks:
    """Remove the first steps of initially parked vehicles, which SUMO inserts on the lane."""
    parked = {trip.name for trip in demand.trips if trip.stop}
    if not parked:
        return tracks
    begins = np.array([name in parked for name in tracks.ids], bool)[tracks.vehicle]
    return take_rows(tracks, ~(begins & (tracks.time_s < demand.begin_s + _PARKED_FROM_S)))


def _as_far_as_measured(tracks: Tracks, demand: MeasuredDemand) -> Tracks:
    """Remove the part of each track beyond the place where the vehicle left the measured area."""
    keep = np.ones(len(tracks), bool)
    lanes, code = np.unique(tracks.lane, return_inverse=True)
    edges = np.array([name.rpartition("_")[0] if name[:1] != ":" else "" for name in lanes.tolist()], dtype=str)[code]
    row = {name: number for number, name in enumerate(tracks.ids)}
    first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids) + 1))
    for trip in demand.trips:
        if trip.leaves_m is None or not trip.onward or trip.name not in row:
            continue
        rows = np.arange(first[row[trip.name]], first[row[trip.name] + 1])
        on = edges[rows] != ""
        street = edges[rows][np.maximum.accumulate(np.where(on, np.arange(len(rows)), 0))]
        visit = 1 + np.cumsum(np.concatenate([[False], street[1:] != street[:-1]]))
        x, y, heading = trip.leaves_at
        ahead = (tracks.place[rows] - (x, y)) @ (np.cos(heading), np.sin(heading))
        beyond = (visit > len(trip.route)) | ((visit == len(trip.route)) & ((ahead > 0) | ~on))
        keep[rows[np.maximum.accumulate(beyond)]] = False
        keep[rows[0]] = True
    return take_rows(tracks, keep)


def _offset_from_centre(tracks: Tracks, behaviour: BehaviourConfig, seed: int) -> Tracks:
    """Add each driver's lateral position in the lane."""
    offset = np.array([draw_habits(behaviour, seed, name).lane_offset_m for name in tracks.ids], float)
    if not offset.any():
        return tracks
    left = np.column_stack([-np.sin(tracks.heading_rad), np.cos(tracks.heading_rad)])
    return replace(tracks, place=tracks.place + left * offset[tracks.vehicle][:, None])


def record(
    sumocfg: Path, behaviour: BehaviourConfig, *, seed: int, step_s: float, warm_up_s: float, seconds: float
) -> Tracks:
    """Trajectories of a scenario's own demand, a sample a step.

    Raises:
        TrafficError: SUMO refuses the scenario.
    """
    recorder, bends, streets = TrackRecorder(step_s), behaviour.cornering_mps2, behaviour.street_speed
    with Traffic(sumocfg, seed, step_s, as_given=True, cornering_mps2=bends, street_speed=streets) as traffic:
        driving = Driving(traffic.api, behaviour, seed, warm_up_s + seconds, step_s, prolong=traffic.prolong_route)
        warm_up = round(warm_up_s / step_s)
        for number in range(warm_up + round(seconds / step_s)):
            actors = traffic.step()
            if number >= warm_up:
                recorder.add(actors)
            driving.step()
    return _offset_from_centre(recorder.tracks(), behaviour, seed)


class TrackRecorder:
    """Gathers samples of vehicles; of those who are parked only now and then.

    Args:
        sample_s: time between two samples.
    """

    def __init__(self, sample_s: float) -> None:
        self._sample_s = sample_s
        self._next_s = -np.inf
        self._parked_s: dict[str, float] = {}
        self._ids: list[str] = []
        self._types: list[str] = []
        self._lanes: list[str] = []
        self._rows: list[np.ndarray] = []

    def add(self, actors: Actors) -> None:
        """Add the vehicles of one step."""
        if actors.time_s < self._next_s - 1e-6:
            return
        first = not np.isfinite(self._next_s)
        self._next_s = (actors.time_s if first else self._next_s) + self._sample_s
        keep = [
            row
            for row in range(len(actors))
            if actors.kinds[row] not in ("pedestrian", "tram") and self._due(actors, row)
        ]
        self._ids += [actors.ids[row] for row in keep]
        self._types += [actors.types[row] for row in keep]
        self._lanes += [actors.lanes[row] for row in keep]
        time_s = np.full(len(keep), actors.time_s)
        speed, heading = actors.speed_mps[keep], actors.heading_rad[keep]
        self._rows.append(np.column_stack([time_s, actors.front[keep, :2], speed, heading]))

    def tracks(self) -> Tracks:
        """All samples so far."""
        values = np.concatenate(self._rows) if self._rows else np.zeros((0, 5))
        return gathered(self._ids, self._types, self._lanes, values[:, 0], values[:, 1:3], values[:, 3], values[:, 4])

    def _due(self, actors: Actors, row: int) -> bool:
        if not actors.parked[row]:
            self._parked_s.pop(actors.ids[row], None)
            return True
        if actors.time_s < self._parked_s.get(actors.ids[row], -np.inf):
            return False
        self._parked_s[actors.ids[row]] = actors.time_s + _BY.parked_every_s
        return True

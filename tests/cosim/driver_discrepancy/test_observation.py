"""Measured and simulated trajectories are compared as they were measured: sampling, noise, speeds from positions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.driver_discrepancy.observation import Observation, resample
from cosim.driver_discrepancy.table import read_measured
from cosim.driver_discrepancy.tracks import Tracks, gathered
from sumo_nets import read_town


def speed(time_s: np.ndarray) -> np.ndarray:
    return 8 + 3 * np.sin(0.5 * time_s)


def way(time_s: np.ndarray) -> np.ndarray:
    return 8 * time_s - 6 * (np.cos(0.5 * time_s) - 1)


def tracks(step_s: float, seconds: float = 20.0, phases_s: tuple[float, ...] = (0.0, 0.013)) -> Tracks:
    """Vehicles eastwards at the same varying speed, sampled at different phases of a clock."""
    times = [phase + np.arange(round(seconds / step_s)) * step_s for phase in phases_s]
    ids = [f"v{who}" for who, time_s in enumerate(times) for _ in time_s]
    time_s = np.concatenate(times)
    place = np.column_stack([way(time_s), np.repeat(10.0 * np.arange(len(times)), [len(t) for t in times])])
    nothing = [""] * len(ids)
    return gathered(ids, ["car"] * len(ids), nothing, time_s, place, speed(time_s), np.zeros(len(ids)))


@pytest.mark.parametrize(("step_s", "expected_s"), [(0.04, 0.1), (1 / 30, 0.1), (0.25, 0.3), (0.12, 0.2)])
def test_samples_are_interpolated_at_the_instants_of_the_simulation(step_s: float, expected_s: float) -> None:
    found, notes = resample(tracks(step_s), 0.1)
    assert len(notes) == 1
    assert (found.time_s - found.start_s) / expected_s == pytest.approx(
        np.round((found.time_s - found.start_s) / expected_s), abs=1e-6
    )
    assert np.diff(found.time_s)[np.diff(found.vehicle) == 0] == pytest.approx(expected_s, abs=1e-6)
    assert found.place[:, 0] == pytest.approx(way(found.time_s), abs=1.5 * step_s**2 / 8 + 1e-9)
    assert found.speed_mps == pytest.approx(speed(found.time_s), abs=0.02)


@pytest.mark.parametrize("step_s", [0.1, 0.2, 0.5])
def test_samples_at_multiples_of_the_step_remain(step_s: float) -> None:
    given = tracks(step_s, phases_s=(0.0, 3 * step_s))
    assert resample(given, 0.1) == (given, [])


def test_a_vehicle_without_a_sample_at_an_instant_is_left_out() -> None:
    given = tracks(0.04)
    short = replace(given, vehicle=np.where(np.arange(len(given)) == len(given) - 1, 2, given.vehicle))
    short = replace(short, ids=("v0", "v1", "v2"), types=("car",) * 3)
    found, _ = resample(short, 0.1)
    assert found.ids == ("v0", "v1") and set(found.vehicle.tolist()) == {0, 1}


def test_speeds_that_were_not_measured_are_those_of_simulated_vehicles_in_the_same_processing(tmp_path: Path) -> None:
    exact = tracks(0.1, phases_s=(0.0, 0.0))
    lines = ["TIMESTAMP,TRACK_ID,OBJECT_TYPE,X,Y,CITY_NAME"]
    for time_s, who, (x, y) in zip(exact.time_s, exact.vehicle, exact.place, strict=True):
        lines.append(f"{time_s + 315969629.0:.2f},0000-{who},OTHERS,{x - 90:.4f},{y:.4f},PIT")
    (tmp_path / "1.csv").write_text("\n".join(lines))
    town = read_town("town01")
    measured = read_measured(tmp_path / "1.csv", town)
    assert measured.derives_speed and not exact.derives_speed
    observation = Observation(derives_speed=True)
    one, other = observation.process(measured), observation.apply(exact, seed=1)
    assert one.speed_mps == pytest.approx(other.speed_mps, abs=0.003)
    assert np.diff(one.place[:, 0]) == pytest.approx(np.diff(other.place[:, 0]), abs=0.003)


def test_trajectories_without_noise_whose_speeds_were_measured_remain() -> None:
    given = tracks(0.1)
    assert Observation().apply(given, seed=1) is given


def test_noise_is_smoothed_on_both_sides_of_an_interruption_by_itself() -> None:
    given = tracks(0.1, phases_s=(0.0,))
    there = (given.time_s < 8) | (given.time_s > 9.5)
    cut = replace(
        given,
        **{name: getattr(given, name)[there] for name in ("vehicle", "time_s", "place", "speed_mps")},
        heading_rad=given.heading_rad[there],
        lane=given.lane[there],
    )
    found = Observation(noise_m=0.05).apply(cut, seed=3)
    assert found.place[:, 0] == pytest.approx(way(cut.time_s), abs=0.15)
    assert found.speed_mps == pytest.approx(speed(cut.time_s), abs=0.8)
    assert np.abs(found.speed_mps - speed(cut.time_s)).mean() < 0.12

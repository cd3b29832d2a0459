"""What a round of a calibration hands to the next one."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.unexplained import Unexplained
from cosim.recordings.calibration.rounds import dropped_effects, effects_of_next_map, is_moved
from sensors.effects.beams.elevation_offset import ElevationOffset
from sensors.effects.beams.sweep_motion import SweepMotion
from sensors.effects.detection.random_dropout import RandomDropout
from sensors.effects.points.range_noise import RangeNoise
from sensors.effects.points.ring_range_offset import RingRangeOffset

GIVEN = (RangeNoise(sigma_m=0.02, sigma_per_m=0.0),)
FOUND = (
    RangeNoise(sigma_m=0.03, sigma_per_m=0.0),
    SweepMotion(sweep_s=0.096),
    ElevationOffset(offset_deg=-0.002),
    RandomDropout(probability=0.1),
)
REFITTED = {
    "sweep_motion": {"params": {"sweep_s": 0.096}, "ci95": {"sweep_s": [0.094, 0.098]}},
    "elevation_offset": {"params": {"offset_deg": -0.002}, "ci95": {"offset_deg": [-0.006, 0.002]}},
    "range_noise": {"params": {"sigma_m": 0.03, "sigma_per_m": 0.0}, "ci95": {"sigma_m": [0.02, 0.04]}},
}


def test_effects_whose_interval_includes_no_change_are_dropped() -> None:
    assert dropped_effects(REFITTED, GIVEN) == ["elevation_offset"]
    assert dropped_effects(REFITTED, (*GIVEN, ElevationOffset(offset_deg=0.2))) == [], "0.2 was given, not 0"


def test_the_next_map_is_made_with_given_effects_and_those_that_move_points() -> None:
    assert effects_of_next_map(FOUND, GIVEN, ["elevation_offset"]) == (*GIVEN, SweepMotion(sweep_s=0.096))
    given = (*GIVEN, SweepMotion(sweep_s=0.1))
    assert effects_of_next_map(FOUND, given, ["elevation_offset"]) == (*GIVEN, SweepMotion(sweep_s=0.096))
    assert effects_of_next_map(FOUND, given, ["sweep_motion", "elevation_offset"]) == given


@pytest.mark.parametrize(("sweep_s", "moves"), [(0.0, True), (0.093, True), (0.095, False), (0.0975, False)])
def test_points_move_where_a_parameter_leaves_its_interval(sweep_s: float, moves: bool) -> None:
    before = (*GIVEN, SweepMotion(sweep_s=sweep_s))
    assert is_moved(REFITTED, before, (*GIVEN, SweepMotion(sweep_s=0.096))) is moves


def test_dropping_a_small_effect_moves_nothing() -> None:
    after = (*GIVEN, SweepMotion(sweep_s=0.096))
    assert not is_moved(REFITTED, (*after, ElevationOffset(offset_deg=-0.003)), after)
    assert is_moved(REFITTED, (*after, ElevationOffset(offset_deg=-0.02)), after)


def test_a_dependence_of_unknown_size_is_read_from_a_stored_round() -> None:
    stored = {"channel": "range", "covariates": ["azimuth"], "size": None, "unit": "m", "p_value": 0.01}
    row = Unexplained.of_json(stored)
    assert row.covariates == ("azimuth",) and np.isnan(row.size)


def test_values_by_laser_are_those_of_the_sensor() -> None:
    offsets = [0.01] * 16
    fitted = {"ring_range_offset": {"params": {"offsets_m": offsets}, "ci95": {"offsets_m": [[0.005, 0.015]] * 16}}}
    found = (*GIVEN, RingRangeOffset(offsets_m=tuple(offsets)))
    assert is_moved(fitted, GIVEN, found) and not is_moved(fitted, found, found)
    assert dropped_effects(fitted, GIVEN) == []
    fitted["ring_range_offset"]["ci95"]["offsets_m"] = [[-0.005, 0.025]] * 16
    assert dropped_effects(fitted, GIVEN) == ["ring_range_offset"]

"""Footprints that meet things at several ranges may answer from any of them."""

import numpy as np
import pytest

from assets.shapes import box
from sensors.effects.expectation import expect
from sensors.effects.surfaces.beam_divergence import ELSEWHERE_CHANCE, density_elsewhere, is_split
from sensors.scene import Scene
from sensors.shot import Shot
from tests.sensors.effects.scenes import effect, no_model, sensor, shoot

_PULSE_M = 0.9


def test_a_footprint_is_split_where_a_gap_is_longer_than_a_pulse() -> None:
    slanted = np.array([20.0, 20.6, 20.0, 19.4, 20.0])
    at_an_edge = np.array([20.0, 20.0, 35.0, 20.0, 20.0])
    half_in_the_sky = np.array([20.0, 20.0, np.inf, 20.0, 20.0])
    assert is_split(np.stack([slanted, at_an_edge, half_in_the_sky]), _PULSE_M).tolist() == [False, True, False]


@pytest.mark.parametrize("ranges", [[20.0, 20.0, 35.0, 20.0, 20.0], [50.0, 47.0, 50.0, 54.0, np.inf]])
def test_other_parts_answer_with_the_stated_chance_in_all(ranges: list[float]) -> None:
    anywhere = np.arange(0.0, 120.0, 0.01)
    every = np.tile(ranges, (len(anywhere), 1))
    density = density_elsewhere(every, is_split(every, _PULSE_M), anywhere, _PULSE_M)
    assert density.sum() * 0.01 == pytest.approx(ELSEWHERE_CHANCE, rel=1e-3)


def test_whole_footprints_answer_from_nowhere_else() -> None:
    whole = np.full((1, 5), 20.0)
    assert density_elsewhere(whole, is_split(whole, _PULSE_M), np.array([20.0]), _PULSE_M) == 0


def test_a_post_between_the_samples_may_answer() -> None:
    wide = effect("beam_divergence", divergence_mrad=6.0, pulse_ns=6.0)
    beside_rad, range_m = 1.6e-3, 20.0
    empty = shoot(sensor(), Scene(box((1, 1, 1), (-300, 0, 0), "concrete"), no_model), pose=np.eye(4))[1]
    azimuth = empty.rays.azimuth[np.argmin(np.abs(empty.rays.azimuth))] + beside_rad
    x, y = range_m * np.cos(azimuth), range_m * np.sin(azimuth)
    post = Scene(box((0.008, 0.008, 8.0), (x, y, 0.0), "steel_galvanised"), no_model)
    whole = shoot(sensor(), post, pose=np.eye(4))[1]
    assert not whole.hits.solid.exists.any(), "it is between the beam centres"
    beside = np.abs(whole.rays.azimuth - (azimuth - beside_rad)) < 1e-6
    rows = np.arange(len(whole.rays))
    again = Shot(whole.pattern, whole.rays, traced=whole.traced, world=whole.world, whole=whole, rows=rows)
    meets = beside & (np.abs(whole.rays.direction[:, 2]) < 0.05)
    there = wide.density(rows, np.full(len(rows), range_m), again)
    assert meets.sum() > 10 and there[meets].min() > 0.01
    assert not there[np.abs(whole.rays.azimuth - azimuth) > 0.01].any()
    expected = expect((wide,), again)
    np.testing.assert_allclose(expected.silent[meets], 1 - ELSEWHERE_CHANCE)
    np.testing.assert_allclose(expected.seen + expected.silent + expected.elsewhere, 1)

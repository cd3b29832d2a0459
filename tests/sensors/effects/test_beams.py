"""Beams that leave otherwise than reported: ranges against closed formulas, to 1 mm, and the sign of every angle."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sensors.motion import EgoMotion
from sensors.pattern import load_pattern
from sensors.scene import Scene
from tests.sensors.effects.scenes import HEIGHT_M, LIDAR, PATTERN, dense, effect, no_model, sensor, shoot
from tests.sensors.worlds import block, instances, plane, pose, wall

RAYS = PATTERN.rays()
AZIMUTH = RAYS.azimuth.astype(float)
ELEVATION = np.arcsin(RAYS.direction[:, 2].astype(float))


def ranges(*effects, scene, **more):
    returns, _ = shoot(sensor(*effects), scene, **more)
    return dense(returns, len(RAYS))


def on_ground(elevation):
    with np.errstate(divide="ignore"):
        expected = np.where(elevation < 0, HEIGHT_M / np.sin(-np.minimum(elevation, -1e-9)), np.nan)
    return np.where(expected < 60, expected, np.nan)


def assert_ranges(result, expected, atol=1e-3):
    both = np.isfinite(result) & np.isfinite(expected)
    assert both.sum() > 1000
    np.testing.assert_allclose(result[both], expected[both], atol=atol)


GROUND = Scene(plane(), no_model)
WALLS = Scene(wall(20.0, half_m=300), no_model)


@settings(max_examples=8, deadline=None)
@given(offset=st.floats(-2, 2))
def test_a_higher_beam_hits_the_ground_at_a_larger_range(offset):
    found = ranges(effect("elevation_offset", offset_deg=offset), scene=GROUND)
    assert_ranges(found, on_ground(ELEVATION + np.radians(offset)))


def test_each_ring_has_its_own_elevation_error():
    offsets = np.random.default_rng(2).uniform(-0.4, 0.4, 64)
    found = ranges(effect("ring_elevation", offsets_deg=tuple(offsets)), scene=GROUND)
    assert_ranges(found, on_ground(ELEVATION + np.radians(offsets)[RAYS.ring]))


@settings(max_examples=8, deadline=None)
@given(pitch=st.floats(-2, 2), roll=st.floats(-2, 2))
def test_pitch_lowers_the_nose_and_roll_lifts_the_left_side(pitch, roll):
    found = ranges(effect("mount_rotation", roll_deg=roll, pitch_deg=pitch, yaw_deg=0.0), scene=GROUND)
    p, r = np.radians([pitch, roll])
    x, y, z = RAYS.direction.astype(float).T
    up = -np.sin(p) * x + np.cos(p) * (np.sin(r) * y + np.cos(r) * z)
    assert_ranges(found, on_ground(np.arcsin(up)), atol=2e-3)


def test_nose_down_brings_the_ground_nearer_in_front_and_farther_behind():
    bare = ranges(scene=GROUND)
    down = ranges(effect("mount_rotation", roll_deg=0.0, pitch_deg=1.0, yaw_deg=0.0), scene=GROUND)
    seen = np.isfinite(bare) & np.isfinite(down) & (bare < 40)
    front, rear = seen & (np.abs(AZIMUTH) < 1), seen & (np.abs(AZIMUTH) > 2.2)
    assert (down[front] < bare[front]).all() and (down[rear] > bare[rear]).all()


@pytest.mark.parametrize("yaw", [-3.0, 2.0])
def test_yaw_turns_the_sensor_to_the_left(yaw):
    found = ranges(effect("mount_rotation", roll_deg=0.0, pitch_deg=0.0, yaw_deg=yaw), scene=WALLS)
    toward = np.cos(ELEVATION) * np.cos(AZIMUTH + np.radians(yaw))
    assert_ranges(found, np.where(toward > 0.3, 20 / np.maximum(toward, 1e-6), np.nan))


def test_an_eccentric_encoder_turns_beams_by_a_sine():
    found = ranges(effect("encoder_eccentricity", amplitude_deg=1.0, phase_deg=40.0), scene=WALLS)
    true = AZIMUTH + np.radians(1.0) * np.sin(AZIMUTH + np.radians(40.0))
    toward = np.cos(ELEVATION) * np.cos(true)
    assert_ranges(found, np.where(toward > 0.3, 20 / np.maximum(toward, 1e-6), np.nan))


def test_a_sensor_shifted_forward_is_nearer_to_the_wall():
    found = ranges(effect("mount_translation", x_m=0.5, y_m=0.2, z_m=-0.1), scene=WALLS)
    assert_ranges(found, np.where(RAYS.direction[:, 0] > 0.3, 19.5 / np.maximum(RAYS.direction[:, 0], 1e-6), np.nan))


def test_points_of_two_blocks_lie_on_the_true_surfaces():
    model = sensor(effect("dual_block", upper_m=0.2, lower_m=-0.1))
    cloud = model.trace_and_measure(GROUND, LIDAR, instances([]), EgoMotion.still(np.eye(4)))
    assert len(cloud) > 50_000
    assert np.abs(cloud.xyz[:, 2] + HEIGHT_M).max() < 2e-3
    found = ranges(effect("dual_block", upper_m=0.2, lower_m=-0.1), scene=GROUND)
    height = HEIGHT_M + np.where(np.array(PATTERN.block)[RAYS.ring] == 0, 0.2, -0.1)
    assert_ranges(found, on_ground(ELEVATION) * height / HEIGHT_M)


def test_two_blocks_put_more_beams_on_far_cars_than_one_centre():
    """Block 0 hits a far car; the other block's centre below lets its top rings reach it as well."""
    single, dual = (
        sensor(pattern=load_pattern("hdl64e_single")),
        sensor(effect("dual_block", upper_m=0.0405, lower_m=-0.0405)),
    )
    counts = {}
    for distance in (40.0, 60.0, 80.0):
        for name, model in (("single", single), ("dual", dual)):
            world = Scene(plane(), lambda _: block((4.0, 1.7, 1.5)))
            returns, _ = shoot(model, world, placed=instances([pose(distance)]))
            counts[name, distance] = int((returns.instance == 0).sum())
    assert all(counts["dual", d] > counts["single", d] for d in (40.0, 60.0, 80.0)), counts


@settings(max_examples=6, deadline=None)
@given(speed=st.floats(-30, 30), side=st.floats(-5, 5))
def test_a_moving_sensor_is_skewed_by_v_times_t(speed, side):
    ego = EgoMotion(np.eye(4), np.array([speed, side, 0.0]), 0.0, np.zeros(3))
    found = ranges(effect("sweep_motion", sweep_s=0.1), scene=WALLS, ego=ego)
    travelled = speed * RAYS.time_s.astype(float)
    toward = RAYS.direction[:, 0].astype(float)
    assert_ranges(found, np.where(toward > 0.3, (20 - travelled) / np.maximum(toward, 1e-6), np.nan))


def test_a_turning_sensor_is_directed_along_its_own_heading():
    ego = EgoMotion(np.eye(4), np.zeros(3), 1.0, np.zeros(3))
    found = ranges(effect("sweep_motion", sweep_s=0.1), scene=WALLS, ego=ego)
    toward = np.cos(ELEVATION) * np.cos(AZIMUTH + RAYS.time_s)
    assert_ranges(found, np.where(toward > 0.3, 20 / np.maximum(toward, 1e-6), np.nan))


@pytest.mark.parametrize("speed", [15.0, -25.0])
def test_a_moving_object_is_met_where_it_is_when_the_beam_fires(speed):
    """A wide board ahead approaches or recedes; the sensor does not move."""
    board = instances([pose(15.0)])
    board = replace(board, velocity_mps=np.array([[speed, 0.0, 0.0]]))
    world = Scene(plane(-50.0), lambda _: wall(0.0, half_m=8.0))
    found = ranges(effect("sweep_motion", sweep_s=0.1), scene=world, placed=board)
    toward, y, z = RAYS.direction.astype(float).T
    at = 15 + speed * RAYS.time_s
    on_board = (toward > 0.5) & (np.abs(y / np.maximum(toward, 1e-6) * at) < 7.5) & (np.abs(z * at) < 6)
    assert_ranges(found, np.where(on_board, at / np.maximum(toward, 1e-6), np.nan))


def test_a_turning_object_is_met_at_its_heading_of_the_moment():
    board = replace(instances([pose(15.0)]), yaw_rate_radps=np.array([2.0]))
    world = Scene(plane(-50.0), lambda _: wall(0.0, half_m=8.0))
    found = ranges(effect("sweep_motion", sweep_s=0.1), scene=world, placed=board)
    angle = 2.0 * RAYS.time_s.astype(float)
    x, y, _ = RAYS.direction.astype(float).T
    # The board's plane: (p − c)·n = 0 with n = (cos, sin) of its heading.
    expected = 15 * np.cos(angle) / np.maximum(x * np.cos(angle) + y * np.sin(angle), 1e-6)
    on_board = (x > 0.5) & (np.abs(y * expected) < 7)
    assert_ranges(found, np.where(on_board, expected, np.nan))


def test_sweep_motion_changes_nothing_at_rest():
    still = ranges(effect("sweep_motion", sweep_s=0.1), scene=GROUND)
    assert_ranges(still, ranges(scene=GROUND), atol=3e-4)


def test_a_late_scan_sees_everything_later():
    ego = EgoMotion(np.eye(4), np.array([10.0, 0, 0]), 0.0, np.zeros(3))
    found = ranges(effect("time_offset", delay_s=0.2), scene=WALLS, ego=ego)
    assert_ranges(found, np.where(RAYS.direction[:, 0] > 0.3, 18 / np.maximum(RAYS.direction[:, 0], 1e-6), np.nan))


def test_accelerating_lifts_the_nose():
    ego = EgoMotion(np.eye(4), np.zeros(3), 0.0, np.array([2.0, 0, 0]))
    found = ranges(effect("suspension_pitch", gain_deg_per_mps2=0.5), scene=GROUND, ego=ego)
    lifted = ranges(effect("mount_rotation", roll_deg=0.0, pitch_deg=-1.0, yaw_deg=0.0), scene=GROUND)
    front = np.abs(AZIMUTH) < 0.3
    bare = ranges(scene=GROUND)
    seen = front & np.isfinite(found) & np.isfinite(bare) & (bare < 30)
    assert seen.sum() > 1000 and (found[seen] > bare[seen]).all()
    # About the ego origin on the ground, so also a little forward: nearly the mount's turn, at almost the same height.
    both = np.isfinite(found) & np.isfinite(lifted) & (lifted < 30)
    assert np.abs(found[both] / lifted[both] - 1).max() < 1e-3

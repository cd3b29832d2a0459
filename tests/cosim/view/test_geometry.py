"""Where things land in the pictures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.drives.kitti import Boxes, Calibration, points_in_boxes
from cosim.view.birds_eye import GroundPlan, draw_from_above
from cosim.view.projection import Viewpoint
from cosim.view.range_image import RangeGrid, nearest_points
from cosim.view.splatting import NOTHING, shade, splat

PLAN = GroundPlan(reach_m=50, size_px=200)
RED, BLUE = (255, 0, 0), (0, 0, 255)


def _where(image: np.ndarray, channel: int) -> np.ndarray:
    """Mean (column, row) of the pixels in which one channel dominates."""
    others = np.delete(image.astype(int), channel, axis=2).max(2)
    rows, columns = np.nonzero(image[..., channel] > others + 60)
    assert len(rows)
    return np.array([columns.mean(), rows.mean()])


def test_straight_ahead_is_above_the_centre_and_left_is_left() -> None:
    points = np.array([[30.0, 0, 0], [0, 20.0, 0]])
    image = draw_from_above(points, np.array([RED, BLUE], np.uint8), PLAN)
    ahead, left = _where(image, 0), _where(image, 2)
    np.testing.assert_allclose(ahead, [99.5, 39.5], atol=1)
    np.testing.assert_allclose(left, [59.5, 99.5], atol=1)


def test_of_points_above_each_other_the_highest_shows() -> None:
    points = np.array([[20.0, 10, 2], [20.0, 10, -1]])
    image = draw_from_above(points, np.array([RED, BLUE], np.uint8), PLAN)
    x, y = np.rint(PLAN.pixels(points[0])).astype(int)
    assert tuple(image[y, x]) == RED


def test_points_outside_the_map_change_nothing() -> None:
    points = np.array([[80.0, 0, 0], [0, -51.0, 0]])
    empty = draw_from_above(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), PLAN)
    np.testing.assert_array_equal(draw_from_above(points, np.array([RED, BLUE], np.uint8), PLAN), empty)


@given(columns=st.integers(2, 4000))
def test_front_is_the_middle_column_of_a_range_image(columns: int) -> None:
    grid = RangeGrid(columns=columns)
    assert grid.column(np.array([0.0]))[0] == columns // 2
    assert grid.column(np.array([np.pi]))[0] == 0
    assert grid.column(np.array([-np.pi + 1e-4]))[0] == columns - 1


@given(firings=st.integers(4, 4000))
def test_every_firing_of_a_pattern_has_its_own_column_in_order(firings: int) -> None:
    azimuth = (np.pi - 2 * np.pi * (np.arange(firings) + 0.5) / firings).astype(np.float32)
    np.testing.assert_array_equal(RangeGrid(columns=firings).column(azimuth), np.arange(firings))


def test_left_of_the_car_is_left_in_a_range_image() -> None:
    grid = RangeGrid()
    assert grid.column(np.array([0.5]))[0] < grid.columns // 2 < grid.column(np.array([-0.5]))[0]


def test_the_nearest_of_two_returns_shows_and_silent_beams_stay_empty() -> None:
    cells = nearest_points(np.array([3, 3]), np.array([0.0, 0.0]), np.array([9.0, 4.0]), RangeGrid(8, 11))
    assert cells[3, 5] == 1
    assert (cells >= 0).sum() == 1


def test_a_view_is_centred_on_its_target_with_left_on_the_left_and_up_on_top() -> None:
    view = Viewpoint.looking((-10, 0, 5), (10, 0, 0), width=101, height=61, field_deg=60)
    uv, depth = view.project(np.array([[10.0, 0, 0], [10.0, 2, 0], [10.0, 0, 2]]))
    np.testing.assert_allclose(uv[0], [50, 30])
    assert uv[1, 0] < 50
    assert uv[2, 1] < 30
    assert depth[0] == pytest.approx(np.hypot(20, 5))


def test_an_enlarged_view_keeps_pixel_positions() -> None:
    view = Viewpoint.looking((0, 0, 0), (1, 0, 0), width=50, height=40, field_deg=70)
    point = np.array([[7.0, 1.3, -0.4]])
    small, large = view.project(point)[0], view.enlarged(3).project(point)[0]
    np.testing.assert_allclose(large, 3 * (small + 0.5) - 0.5)


@given(x=st.floats(6, 40), y=st.floats(-3, 3), yaw=st.floats(-np.pi, np.pi), seed=st.integers(0, 2**32 - 1))
def test_a_box_is_drawn_around_the_points_in_it(x: float, y: float, yaw: float, seed: int) -> None:
    turn = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0]])
    projection = np.array([[200.0, 0, 100, 0], [0, 200.0, 40, 0], [0, 0, 1, 0]])
    view = Viewpoint.of_camera(Calibration(P2=projection, R0_rect=np.eye(3), Tr_velo_to_cam=turn), 2, 200, 80)
    box = Boxes(np.array([[x, y, -0.5]]), np.array([[4.0, 1.8, 1.5]]), np.array([yaw]))
    points = np.random.default_rng(seed).uniform([x - 3, y - 3, -1.5], [x + 3, y + 3, 0.5], (300, 3))
    inside = points[points_in_boxes(points, box)[0]]
    lines = view.wire(box.corners[0]).reshape(-1, 2)
    uv, _ = view.project(inside)
    assert (uv >= lines.min(0) - 1e-6).all()
    assert (uv <= lines.max(0) + 1e-6).all()


def test_lines_are_cut_before_the_camera_and_lines_behind_it_are_not_drawn() -> None:
    view = Viewpoint.looking((0, 0, 0), (1, 0, 0), width=50, height=40, field_deg=70)
    lines = view.segments(np.array([[-5.0, 1, 0], [-5.0, 1, 0]]), np.array([[5.0, 1, 0], [-1.0, 1, 0]]))
    assert lines.shape == (1, 2, 2)
    assert np.isfinite(lines).all()


def test_the_nearest_disc_hides_those_behind_it() -> None:
    view = Viewpoint.looking((0, 0, 0), (1, 0, 0), width=41, height=41, field_deg=60)
    points = np.array([[10.0, 0, 0], [5.0, 0, 0]])
    splats = splat(points, np.array([0.5, 0.2]), view, limits_px=(1, 20))
    assert splats.index[20, 20] == 1
    assert splats.depth[20, 20] == pytest.approx(5, abs=0.2)
    assert splats.index[0, 0] == NOTHING
    assert not np.isfinite(splats.depth[0, 0])


def test_a_slanting_plane_stays_bright_and_the_foot_of_a_step_darkens() -> None:
    ramp = np.tile(np.exp2(np.linspace(2, 2.5, 60)).astype(np.float32), (20, 1))
    assert shade(ramp, 2, 40)[5:-5, 5:-5].min() > 0.99
    step = np.full((20, 60), 10.0, np.float32)
    step[:, :30] = 8
    light = shade(step, 2, 40)
    assert light[10, 31] < 0.9
    assert light[10, 28] == pytest.approx(1)
    assert light[10, 50] == pytest.approx(1)

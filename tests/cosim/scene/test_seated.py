"""Persons that sit: which seats they take, and where their boxes are."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from assets import build_model
from assets.models.pedestrian import HIP_BEHIND
from assets.world.buildings.plots import lay_out
from assets.world.environment import Environment
from assets.world.furniture.furnishing import furnish
from assets.world.obstacles import Obstacles
from assets.world.roads.kerbside import kerbside
from assets.world.roads.surfaces import outline
from assets.world.styles import style_of
from cosim.labels.labelling import KITTI_TYPE
from cosim.scene.seated import seat_persons
from sensors.bvh import Bvh
from tests.assets.small_town import small_town


@pytest.fixture(scope="module")
def furnished():
    """Furniture of a street of shops on level ground, and its seats."""
    streets, rng = small_town("urban"), np.random.default_rng(3)
    outlines, style = outline(streets), style_of("urban")
    plots = lay_out(outlines.paved, style, rng)
    blocked = Obstacles(streets, outlines, outlines.paved, plots, shapely.Polygon())
    environment = Environment({"bench": 6.0, "table": 6.0, "bus_stop": 2.0})
    return furnish(kerbside(streets, outlines), blocked, lambda xy: np.zeros(len(xy)), style, environment, rng)


def test_seats_are_surfaces_at_the_height_of_a_seat(furnished):
    mesh, seats = furnished
    assert len(seats) > 5
    hips = seats[:, :3, 3] + seats[:, :3, 0] * 0.05
    down = np.tile(np.array([[0, 0, -1]], np.float32), (len(seats), 1))
    start = (hips + np.array([0, 0, 0.62])).astype(np.float32)
    distance, triangle = Bvh(mesh).first_hit(start, down, np.full(len(seats), 1.0, np.float32))
    assert (triangle >= 0).all()
    height = 0.62 - distance
    assert (height > 0.4).all() and (height < 0.52).all()


def test_persons_sit_on_the_share_of_seats_that_is_configured():
    seats = np.tile(np.eye(4), (2000, 1, 1))
    assert len(seat_persons(seats, 0.0, 1)) == 0
    assert len(seat_persons(seats, 1.0, 1)) == 2000
    assert len(seat_persons(seats, 0.1, 1)) == pytest.approx(200, abs=50)


def test_a_seat_is_taken_by_the_same_person_whatever_the_others(furnished):
    _, seats = furnished
    everybody, fewer = seat_persons(seats, 0.5, 7), seat_persons(seats[:4], 0.5, 7)
    assert everybody.ids[: len(fewer)] == fewer.ids
    np.testing.assert_array_equal(everybody.poses[: len(fewer)], fewer.poses)
    assert seat_persons(seats, 0.5, 7).models == everybody.models
    assert seat_persons(seats, 0.5, 8).ids != everybody.ids


def test_the_box_of_a_person_stands_on_the_ground_before_the_seat(furnished):
    _, seats = furnished
    seated = seat_persons(seats, 1.0, 2)
    assert set(seated.kinds) == {"person_sitting"} and KITTI_TYPE["person_sitting"] == "Person_sitting"
    np.testing.assert_allclose(seated.poses[:, 2, 3], seats[:, 2, 3])
    hips = seated.poses[:, :3, 3] - HIP_BEHIND * seated.sizes[:, :1] * seated.poses[:, :3, 0]
    np.testing.assert_allclose(hips, seats[:, :3, 3], atol=1e-9)
    assert (np.einsum("ij,ij->i", seated.poses[:, :3, 0], seats[:, :3, 0]) > 0.95).all()
    for model, size in zip(seated.models, seated.sizes, strict=True):
        np.testing.assert_allclose(np.ptp(build_model(model).bounds, axis=0), size, atol=1e-5)

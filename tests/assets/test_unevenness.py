"""Ground is no plane, and what lies on it follows."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from assets.world.ground.overlays import ribbons
from assets.world.ground.plan import CARRIAGEWAY, PAVEMENT, TERRAIN
from assets.world.ground.unevenness import unevenness
from assets.world.groundwork import lay_groundwork

from .small_town import small_town
from .test_world import fall, points_in


@pytest.fixture(scope="module")
def base():
    return lay_groundwork(small_town())


def second_differences(base, points, lag_m):
    turn = np.random.default_rng(0).uniform(0, 2 * np.pi, len(points))
    step = lag_m * np.column_stack([np.cos(turn), np.sin(turn)])
    before, here, behind = (base.height(points + k * step) for k in (-1, 0, 1))
    return before - 2 * here + behind


def middles(base, zone):
    return base.plan.points[base.plan.faces[base.plan.zone == zone]].mean(1)


def test_a_name_says_all_of_a_towns_unevenness(base):
    again, other = unevenness(base.plan, "small"), unevenness(base.plan, "another")
    assert unevenness(base.plan, "small").tobytes() == again.tobytes()
    assert other.tobytes() != again.tobytes()
    assert lay_groundwork(replace(base.streets, name="another")).ground.vertices.tobytes() != (
        base.ground.vertices.tobytes()
    )


def test_roads_are_even_to_a_centimetre_or_two_and_land_less_so(base):
    verge = middles(base, TERRAIN)
    verge = verge[shapely.dwithin(base.paved, shapely.points(verge), 2.0)]
    road, land = (np.std(second_differences(base, points, 1.0)) for points in (middles(base, CARRIAGEWAY), verge))
    assert 0.003 < road < 0.015
    assert land > 1.5 * road


def test_unevenness_grows_with_the_distance_over_which_it_is_looked_at(base):
    road = middles(base, CARRIAGEWAY)
    spread = [np.std(second_differences(base, road, lag)) for lag in (0.5, 1.0, 2.0, 4.0)]
    assert (np.diff(spread) > 0).all()


def test_roads_fall_to_their_gutters(base):
    edge = shapely.boundary(base.outlines.carriageway)
    offset = unevenness(base.plan, "small")
    road = np.unique(base.plan.faces[base.plan.zone == CARRIAGEWAY])
    away = shapely.distance(edge, shapely.points(base.plan.points[road]))
    slope = np.polyfit(np.minimum(away, 4.0), offset[road], 1)[0]
    assert slope == pytest.approx(0.015, abs=0.005)


def test_heights_are_those_of_the_mesh(base):
    for zone, shape in ((CARRIAGEWAY, base.outlines.carriageway), (PAVEMENT, base.outlines.pavement)):
        xy = points_in(shapely.difference(shape, shapely.buffer(base.outlines.crossings, 3.0)), 1000)
        z, _ = fall(base.ground, xy)
        np.testing.assert_allclose(base.relief.z(xy, zone), z, atol=2e-4)


def test_paint_lies_on_the_road_and_neither_under_nor_far_over_it(base):
    corner = base.markings.triangles.astype(np.float64)
    share = np.random.default_rng(0).dirichlet(np.ones(3), len(corner))
    point = np.einsum("nk,nkj->nj", share, corner)
    over = point[:, 2] - base.height(point[:, :2])
    assert (over > 0).mean() > 0.995
    assert over.min() > -0.004 and over.max() < 0.03


def test_a_ribbon_over_a_ridge_is_nowhere_below_it():
    def ridge(xy):
        return -0.05 * np.abs(xy[:, 0] - 0.47)

    mesh = ribbons(np.array([[0.0, 0.0]]), np.array([[5.0, 0.0]]), 2.0, ridge, "asphalt_patch")
    z, _ = fall(mesh, np.column_stack([np.linspace(0.01, 4.99, 99), np.full(99, 0.3)]))
    assert (z - ridge(np.column_stack([np.linspace(0.01, 4.99, 99), np.zeros(99)])) > -3e-3).all()

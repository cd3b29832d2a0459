"""Streets above each other: each lane has its own surface, and what lies on the land is as without bridges."""

from __future__ import annotations

import numpy as np
import pytest

from assets.streets import StreetLane, Streets
from assets.world.build import build_world
from assets.world.groundwork import lay_groundwork
from assets.world.roads.bridges import split_levels
from sensors.bvh import Bvh

HALF_M = 110.0


def lane(name: str, *points: tuple[float, float, float]) -> StreetLane:
    return StreetLane(f"{name}_0", name, "drive", np.array(points, float), 3.2, 13.9, False)


def streets(name: str, *lanes: StreetLane) -> Streets:
    return Streets(name, lanes, (), (), ())


def over(z: float, x: float = 0.0, name: str = "up") -> StreetLane:
    """A lane to the north that reaches a height 40 m before it crosses the x axis."""
    return lane(name, (x, -HALF_M, 0), (x, -40, z), (x, 40, z), (x, HALF_M, 0))


LOW = lane("low", (-HALF_M, 0, 0), (HALF_M, 0, 0))
CUT = lane("cut", (-HALF_M, 0, 0), (-45, 0, -6), (45, 0, -6), (HALF_M, 0, 0))
FLAT = lane("flat", (0, -HALF_M, 0), (0, HALF_M, 0))
OVERPASS = streets("overpass", LOW, over(7.0))
UNDERPASS = streets("underpass", FLAT, CUT)
THREE = streets("three", LOW, over(6.0), lane("top", (-90, -90, 6), (-40, -40, 12), (40, 40, 12), (90, 90, 6)))
PAIR = streets("pair", LOW, over(7.0), over(7.0, 3.2, "beside"))
SLOPED = streets("sloped", lane("low", (-HALF_M, 0, 10), (HALF_M, 0, 0)), over(12.0))


def surface_heights(net: Streets, points: np.ndarray) -> np.ndarray:
    """Heights (n,) of the surface below 1.5 m above each point."""
    start = points.astype(np.float32) + np.array([0, 0, 1.5], np.float32)
    down = np.tile(np.array([[0, 0, -1]], np.float32), (len(start), 1))
    distance, _ = Bvh(lay_groundwork(net).ground).first_hit(start, down, np.full(len(start), 9, np.float32))
    return start[:, 2] - distance


@pytest.mark.parametrize("net", [OVERPASS, UNDERPASS, THREE, PAIR, SLOPED], ids=lambda net: net.name)
def test_each_lane_has_a_surface_at_its_height(net):
    for each in net.lanes:
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(each.centre[:, :2], axis=0), axis=1))])
        at = np.arange(3.0, along[-1] - 3, 4.0)
        points = np.column_stack([np.interp(at, along, each.centre[:, axis]) for axis in range(3)])
        away = np.abs(surface_heights(net, points) - points[:, 2])
        assert np.quantile(away, 0.9) < 0.15, each.id
        assert away.max() < 0.6, each.id


@pytest.mark.parametrize(("net", "count"), [(OVERPASS, 1), (UNDERPASS, 1), (THREE, 2), (PAIR, 1)])
def test_lanes_side_by_side_share_a_deck_and_levels_do_not(net, count):
    _, decks = split_levels(net)
    assert len(decks) == count


def test_streets_without_levels_stay_as_they_are():
    flat = streets("flat", LOW, FLAT)
    hill = streets("hill", lane("a", (-HALF_M, 0, 0), (HALF_M, 0, 25)), lane("b", (-HALF_M, 3.2, 0), (HALF_M, 3.2, 25)))
    for net in (flat, hill):
        ground, decks = split_levels(net)
        assert ground is net and decks == ()


def test_rays_pass_below_a_bridge_and_meet_its_slab_from_below():
    bvh = Bvh(lay_groundwork(OVERPASS).ground)
    start = np.array([[-20, 0, 1.7], [0, 0, 1.7]], np.float32)
    ways = np.array([[1, 0, 0], [0, 0, 1]], np.float32)
    distance, triangle = bvh.first_hit(start, ways, np.full(2, 60, np.float32))
    assert triangle[0] < 0
    assert distance[1] == pytest.approx(7.0 - 0.9 - 1.7, abs=0.1)


def test_railings_are_along_a_bridge_and_piers_next_to_the_road_below():
    mesh = lay_groundwork(OVERPASS).bridges
    railing = mesh.vertices[mesh.vertices[:, 2] > 7.5]
    assert len(railing) and (np.abs(np.abs(railing[:, 0]) - 1.5) < 0.21).all()
    piers = mesh.vertices[mesh.vertices[:, 2] < 3]
    assert len(piers) and (np.abs(piers[:, 1]) > 1.6).all()


@pytest.mark.parametrize("spacing_m", [3.2, 3.7])
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_no_railing_stands_on_a_lane(count, spacing_m):
    lanes = [over(7.0, (k - (count - 1) / 2) * spacing_m, f"up{k}") for k in range(count)]
    mesh = lay_groundwork(streets("wide", LOW, *lanes)).bridges
    railing = mesh.triangles[mesh.triangles[..., 2].max(1) > 7.5]
    half_m = (count - 1) / 2 * spacing_m + 1.6
    assert len(railing) and (np.abs(railing[..., 0]) > half_m - 0.25).all()
    assert railing[..., 1].min() < -35 and railing[..., 1].max() > 35


@pytest.mark.parametrize("net", [OVERPASS, UNDERPASS, THREE], ids=lambda net: net.name)
def test_nothing_on_the_land_reaches_through_a_deck(net):
    """Above a deck there is only air: straight up from its lanes, and along them at the height of a bonnet."""
    for seed in (1, 2):
        world = Bvh(build_world(net, seed).mesh)
        for deck in split_levels(net)[1]:
            for each in deck.streets.lanes:
                middle = each.centre[3:-3:2] + np.array([0, 0, 0.6])
                for across in (-1.0, 0.0, 1.0):
                    points = (middle + np.array([across, 0, 0])).astype(np.float32)
                    ahead = np.diff(points, axis=0, append=points[-1:] + np.float32([[0, 0, 3]]))
                    length = np.linalg.norm(ahead, axis=1)
                    up = np.tile(np.array([[0, 0, 1]], np.float32), (len(points), 1))
                    assert (world.first_hit(points, up, np.full(len(points), 3.2, np.float32))[1] < 0).all()
                    assert (world.first_hit(points, ahead / length[:, None], length)[1] < 0).all()

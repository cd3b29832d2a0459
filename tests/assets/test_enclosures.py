"""Borders that close open street fronts."""

import numpy as np
import pytest
import shapely

from assets.world.borders.enclosures import enclose
from assets.world.borders.gardens import garden_borders
from assets.world.buildings.houses import design
from assets.world.buildings.plots import lay_out
from assets.world.obstacles import Obstacles
from assets.world.roads.surfaces import crossroads, outline
from assets.world.styles import STYLES, style_of

from .small_town import slope, small_town


def closed(style, seed=2):
    """Streets, outlines, houses, closing borders and garden borders of a small town."""
    town, rules, rng = small_town(style), style_of(style), np.random.default_rng(seed)
    outlines = outline(town)
    plots = lay_out(outlines.paved, rules, rng)
    houses = design(plots, rules, lambda xy: slope(*xy.T), rng)
    blocked = Obstacles(town, outlines, outlines.paved, plots, shapely.Polygon())
    gardens = garden_borders(houses, blocked, rules, rng)
    borders, _ = enclose(town, outlines, houses, gardens, blocked, rules, rng)
    return town, outlines, houses, borders, gardens


def lines_of(borders):
    return [shapely.LineString(ends) for ends in zip(borders.start, borders.end, strict=True)]


@pytest.mark.parametrize("style", sorted(STYLES))
def test_borders_keep_off_the_pavement_the_houses_and_the_ways_to_their_doors(style):
    _, outlines, houses, borders, _ = closed(style)
    lines = lines_of(borders)
    assert not shapely.intersects(outlines.paved, lines).any()
    for house in houses:
        plot = house.plot
        gate = plot.front + plot.along * house.door_m
        way = shapely.LineString([gate, gate + plot.inward * plot.setback_m])
        assert not shapely.dwithin(lines, way, 1.0).any()
        assert not shapely.intersects(lines, shapely.Polygon(plot.corners())).any()


@pytest.mark.parametrize("style", ["village", "hamlet", "suburb"])
def test_borders_at_crossroads_are_low_enough_to_look_over(style):
    town, outlines, _, borders, _ = closed(style)
    near = shapely.dwithin(crossroads(town, outlines.carriageway), lines_of(borders), 3.5)
    assert (borders.rise[near] * 1.8 < 1.2).all()
    assert (borders.rise[~near] > 0.8).any()


def test_borders_stop_most_lines_of_sight_that_houses_leave_open_in_a_village():
    """From the road slantwise into the land, 40 m far; gateways and paths leave some."""
    rng = np.random.default_rng(0)
    start = np.column_stack([rng.uniform(20.0, 70.0, 400), rng.choice([-0.5, 0.5], 400)])
    aside = np.sign(start[:, 1]) * rng.uniform(np.pi / 4, np.pi / 2, 400)
    end = start + 40.0 * np.column_stack([np.cos(aside), np.sin(aside)])
    sight = shapely.linestrings(np.stack([start, end], axis=1))
    left_open, stopped = 0, 0
    for seed in range(4):
        _, _, houses, borders, gardens = closed("village", seed)
        homes = shapely.MultiPolygon([shapely.Polygon(house.plot.corners()) for house in houses])
        free = ~shapely.intersects(sight, homes)
        walls = shapely.multilinestrings([*lines_of(borders), *lines_of(gardens)])
        left_open, stopped = left_open + free.sum(), stopped + (free & shapely.intersects(sight, walls)).sum()
    assert stopped > 0.55 * left_open


def test_a_bend_is_no_crossroads_but_a_crossing_of_four_arms_is():
    town = small_town()
    outlines = outline(town)
    assert len(shapely.get_parts(crossroads(town, outlines.carriageway))) == 1
    one_road = shapely.intersection(outlines.carriageway, shapely.box(-200.0, -4.0, 200.0, 4.0))
    assert shapely.is_empty(crossroads(town, one_road))


def test_the_same_generator_gives_the_same_borders():
    *_, first, _ = closed("suburb")
    *_, again, _ = closed("suburb")
    np.testing.assert_array_equal(first.start, again.start)
    np.testing.assert_array_equal(first.kind, again.kind)

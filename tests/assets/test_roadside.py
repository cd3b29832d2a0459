"""Plants and objects next to streets are at plausible positions."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from assets.materials import material_index
from assets.world import roadside
from assets.world.climbers import climbers_mesh
from assets.world.greenery import trees_mesh
from assets.world.houses import design
from assets.world.kerbside import kerbside
from assets.world.obstacles import Obstacles
from assets.world.plots import lay_out
from assets.world.styles import STYLES, style_of
from assets.world.surfaces import outline

from .small_town import small_town

_LEAVES = [material_index(name) for name in ("foliage", "foliage_dark")]


def _flat(xy):
    return np.zeros(len(xy))


@pytest.mark.parametrize("name", ["trailer", "skip", "barrier", "scooter", "utility_pole", "glass_banks"])
def test_objects_next_to_streets_are_on_the_ground_and_differ(name):
    make = getattr(roadside, name)
    one, again, *others = (make(np.random.default_rng(seed)) for seed in (0, 0, 1, 2, 3, 4, 5))
    assert one.bounds[0, 2] == pytest.approx(0, abs=0.06) and len(one.faces) < 300
    assert one.vertices.tobytes() == again.vertices.tobytes()
    assert any(one.vertices.tobytes() != other.vertices.tobytes() for other in others)


@pytest.mark.parametrize("style", ["suburb", "urban"])
def test_climbing_plants_cover_walls_from_outside(style):
    rng = np.random.default_rng(2)
    houses = design(lay_out(outline(small_town(style)).paved, style_of(style), rng), style_of(style), _flat, rng)
    leaves = climbers_mesh(houses, _flat, 1.0, rng)
    walls = shapely.union_all([shapely.Polygon(house.plot.corners()) for house in houses])
    middles = shapely.points(leaves.triangles.mean(1)[:, :2])
    assert len(leaves.faces) > 100 * len(houses) / 2
    assert shapely.distance(walls, middles).max() < 0.6
    assert shapely.contains(walls, middles).mean() < 0.25
    assert leaves.bounds[1, 2] < max(house.eaves_m for house in houses) + 0.6
    assert not len(climbers_mesh(houses, _flat, 0.0, rng).faces)


@pytest.mark.parametrize("style", sorted(STYLES))
def test_beds_bring_leaves_that_grow_next_to_paved_areas(style):
    streets = small_town(style)
    outlines = outline(streets)
    counts = []
    for gap_m in (0.0, 12.0):
        rules = replace(style_of(style), bed_gap_m=gap_m, street_tree_gap_m=0.0, garden_trees=0, garden_shrubs=0)
        rules = replace(rules, wild_trees=0.0)
        blocked = Obstacles(streets, outlines, outlines.paved, [], shapely.Polygon())
        bounds = np.array([[-80.0, -80.0], [80.0, 80.0]])
        edge, rng = kerbside(streets, outlines), np.random.default_rng(1)
        mesh = trees_mesh(edge, [], bounds, blocked, _flat, rules, rng)
        leaves = mesh.select(np.isin(mesh.materials, _LEAVES) & (mesh.triangles[..., 2].max(1) < 4.0))
        counts.append(len(leaves.faces))
    assert counts[1] > counts[0] + 1000
    stems = blocked._taken[:, :2]
    assert shapely.distance(outlines.paved, shapely.points(stems)).min() > 0.5

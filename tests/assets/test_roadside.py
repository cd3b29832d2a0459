"""Plants and objects next to streets are at plausible positions."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from assets.materials import material_index
from assets.world.buildings.houses import design
from assets.world.buildings.plots import lay_out
from assets.world.furniture import roadside
from assets.world.furniture.lines import overhead_lines, wire
from assets.world.obstacles import Obstacles
from assets.world.plants.greenery import climbers_mesh, trees_mesh
from assets.world.roads.kerbside import kerbside
from assets.world.roads.surfaces import outline
from assets.world.styles import STYLES, style_of

from .rays import first_hits
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


def test_a_wire_sags_as_a_parabola_and_hides_no_more_than_its_width():
    span_m, tall_m = 40.0, 8.0
    hung = wire(np.array([0.0, 10.0, tall_m]), np.array([span_m, 10.0, tall_m]))
    assert hung.bounds[0, 2] == pytest.approx(tall_m - 4e-4 * span_m**2, abs=0.03)
    height = np.arange(4.0, 9.0, 0.002)
    rays = np.tile([0.0, 1.0, 0.0], (len(height), 1))
    hit = np.isfinite(
        first_hits(hung, np.column_stack([np.full(len(height), 15.0), np.zeros(len(height)), height]), rays)[0]
    )
    assert 0.01 < hit.mean() * 5.0 < 0.03


@pytest.mark.parametrize("style", ["suburb", "urban"])
def test_overhead_lines_stand_on_pavements_and_their_wires_clear_the_traffic(style):
    streets = small_town(style)
    outlines = outline(streets)
    edge = kerbside(streets, outlines)
    blocked = Obstacles(streets, outlines, outlines.paved, [], shapely.Polygon())
    mesh = overhead_lines(edge, blocked, _flat, 12, np.random.default_rng(4))
    again = Obstacles(streets, outlines, outlines.paved, [], shapely.Polygon())
    assert (
        mesh.vertices.tobytes() == overhead_lines(edge, again, _flat, 12, np.random.default_rng(4)).vertices.tobytes()
    )
    poles = shapely.points(blocked._taken[:, :2])
    assert 6 <= len(poles) <= 12
    assert shapely.contains(outlines.pavement, poles).all()
    wires = mesh.select(
        (mesh.materials == material_index("plastic_dark"))
        & (np.ptp(mesh.triangles[..., 0], 1) + np.ptp(mesh.triangles[..., 1], 1) > 1.0)
    )
    assert len(wires.faces) > 0
    assert wires.bounds[0, 2] > 5.5


def test_woods_close_the_view_at_the_border_of_the_land():
    streets = small_town("suburb")
    outlines = outline(streets)
    low, high = (
        shapely.get_coordinates(outlines.paved).min(0) - 120.0,
        shapely.get_coordinates(outlines.paved).max(0) + 120.0,
    )
    rules = replace(
        style_of("suburb"), bed_gap_m=0.0, street_tree_gap_m=0.0, garden_trees=0, garden_shrubs=0, wild_trees=0.0
    )
    blocked = Obstacles(streets, outlines, outlines.paved, [], shapely.Polygon())
    mesh = trees_mesh(
        kerbside(streets, outlines), [], np.stack([low, high]), blocked, _flat, rules, np.random.default_rng(1)
    )
    turn = np.radians(np.arange(0.0, 360.0, 0.5))
    middle = np.append((low + high) / 2, 4.0)
    for elevation_deg, share in ((1.0, 0.7), (2.0, 0.5)):
        up = np.radians(elevation_deg)
        rays = np.column_stack([np.cos(turn) * np.cos(up), np.sin(turn) * np.cos(up), np.full(len(turn), np.sin(up))])
        assert np.isfinite(first_hits(mesh, np.tile(middle, (len(turn), 1)), rays)[0]).mean() >= share
    assert shapely.distance(outlines.paved, shapely.points(blocked._taken[:, :2])).min() > 3.0

"""What users of a built world rely on."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from assets.materials import MATERIAL_NAMES, material_index
from assets.world.build import build_world
from assets.world.buildings.construction import buildings_mesh
from assets.world.buildings.houses import design
from assets.world.buildings.plots import lay_out
from assets.world.ground.plan import CARRIAGEWAY, PAVEMENT, triangulate
from assets.world.roads.surfaces import outline
from assets.world.styles import STYLES, style_of

from .small_town import slope, small_town

ROAD = ("asphalt", "asphalt_patch", "road_marking", "manhole")


@pytest.fixture(scope="module")
def streets():
    return small_town()


@pytest.fixture(scope="module")
def world(streets):
    return build_world(streets, seed=5)


@pytest.fixture(scope="module")
def outlines(streets):
    return outline(streets)


@pytest.fixture(scope="module")
def plan(outlines, world):
    return triangulate(outlines, *world.bounds)


def of_materials(mesh, *names):
    return mesh.select(np.isin(mesh.materials, [material_index(name) for name in names]))


def cast(mesh, origins, directions):
    """Range (inf for a miss) and material row of the first hit of every ray."""
    scene = EmbreeScene(robust=True)
    TriangleMesh(scene, mesh.vertices, mesh.faces)
    origins, directions = (np.ascontiguousarray(a, np.float32) for a in (origins, directions))
    dists = np.full(len(origins), 1e6, np.float32)
    hit = scene.run(origins, directions, dists, "INTERSECT", output=True)
    missed = hit["primID"] < 0
    return np.where(missed, np.inf, hit["tfar"]), np.where(missed, -1, mesh.materials[hit["primID"]])


def fall(mesh, xy, from_z=100.0):
    """Height of the topmost surface under points in the plane."""
    origins = np.column_stack([xy, np.full(len(xy), from_z)])
    ranges, materials = cast(mesh, origins, np.tile([0.0, 0.0, -1.0], (len(xy), 1)))
    return from_z - ranges, materials


def plan_areas(corners):
    """Areas (n,) of triangles (n, 3, 2) in the plane."""
    (ax, ay), (bx, by), (cx, cy) = np.moveaxis(corners, (1, 2), (0, 1))
    return np.abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2


def points_in(shape, count=4000, inset=0.02):
    rng = np.random.default_rng(0)
    inner = shapely.buffer(shape, -inset)
    low, high = np.array(inner.bounds).reshape(2, 2)
    xy = rng.uniform(low, high, (40 * count, 2))
    return xy[shapely.contains_xy(inner, xy[:, 0], xy[:, 1])][:count]


def test_the_surface_follows_the_lanes_as_evenly_as_roads_are(world, streets):
    lanes = np.concatenate([lane.centre for lane in streets.lanes])
    away = world.height(lanes[:, :2]) - lanes[:, 2]
    assert abs(away.mean()) < 0.04 and away.std() < 0.04
    np.testing.assert_allclose(world.height(lanes[:, :2]), lanes[:, 2], atol=0.15)


def test_the_whole_carriageway_is_paved_without_holes_at_the_height_of_the_surface(world, outlines):
    xy = points_in(outlines.carriageway)
    z, material = fall(world.ground, xy)
    np.testing.assert_allclose(z, world.height(xy), atol=0.01)
    assert set(material) == {material_index("asphalt")}


def test_the_pavement_is_twelve_centimetres_up_and_lowered_at_crossings(world, outlines):
    xy = points_in(outlines.pavement, 2000)
    z, _ = fall(world.ground, xy)
    rise = z - world.height(xy)
    away = shapely.distance(outlines.crossings, shapely.points(xy))
    np.testing.assert_allclose(rise[away > 4.0], 0.12, atol=0.01)
    assert rise[away < 0.2].max() < 0.06


def test_ground_has_no_gap_anywhere_on_the_land(world):
    xy = np.random.default_rng(1).uniform(world.bounds[0] + 0.1, world.bounds[1] - 0.1, (20000, 2))
    z, _ = fall(world.ground, xy)
    assert np.isfinite(z).all()
    assert np.abs(z - world.height(xy)).max() < 0.35


def test_a_beam_at_grazing_incidence_finds_no_crack_between_road_kerb_and_land(world):
    """The ground is one closed sheet: every edge inside it is shared by two faces or meets a kerb."""
    rng = np.random.default_rng(2)
    xy = rng.uniform(-60, 60, (5000, 2))
    origin = np.column_stack([xy, world.height(xy) - 0.5])  # from below: a crack would let light in
    upward = np.column_stack([rng.normal(0, 3, (5000, 2)), np.ones(5000)])
    ranges, _ = cast(world.ground, origin, upward / np.linalg.norm(upward, axis=1, keepdims=True))
    assert np.isfinite(ranges).all()


def test_zones_cover_exactly_their_outlines(plan, outlines):
    corners = plan.points[plan.faces]
    area = plan_areas(corners)
    assert area[plan.zone == CARRIAGEWAY].sum() == pytest.approx(outlines.carriageway.area, rel=1e-3)
    assert area[plan.zone == PAVEMENT].sum() == pytest.approx(outlines.pavement.area, rel=5e-3)


def test_road_triangles_are_well_shaped(plan):
    corners = plan.points[plan.faces[plan.zone == CARRIAGEWAY]]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    area = plan_areas(corners)
    aspect = sides.max(1) ** 2 / (2 * area)  # longest side over its height; 1.15 when equilateral
    assert sides.max() < 4.5
    assert np.percentile(aspect, 99) < 8.0


def test_faces_have_area_and_normals_of_the_ground_point_up_or_sideways(world):
    corners = world.mesh.triangles.astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert (area > 1e-8).mean() > 0.9999
    assert world.ground.normals[:, 2].min() > -0.01


@pytest.mark.parametrize("style", sorted(STYLES))
def test_no_house_touches_a_street_or_another_house(style):
    outlines = outline(small_town(style))
    plots = lay_out(outlines.paved, style_of(style), np.random.default_rng(3))
    shapes = [shapely.polygons(plot.corners()) for plot in plots]
    assert len(shapes) > 2
    assert not shapely.intersects(outlines.paved, shapes).any()
    assert len(shapely.STRtree(shapes).query(shapes, "intersects")[0]) == len(shapes)


@pytest.mark.parametrize("style", sorted(STYLES))
def test_street_fronts_are_built_up_as_the_style_says(style):
    """Fronts and gaps as drawn would leave this share built; corners and meadows take the rest."""
    rules, outlines = style_of(style), outline(small_town(style))
    front_m, gap_m = np.mean(rules.front_m), np.mean(rules.side_gap_m)
    drawn = front_m / (front_m + gap_m) * (1 - rules.gap_share)
    plots = [plot for seed in range(6) for plot in lay_out(outlines.paved, rules, np.random.default_rng(seed))]
    built = sum(plot.size_m[0] for plot in plots) / (6 * 8 * 72.0)  # both sides of four arms of 72 m
    assert 0.2 * drawn < built < drawn
    assert built > 0.5 if rules.terrace else built < 0.5


@pytest.mark.parametrize("style", sorted(STYLES))
def test_nothing_solid_stands_in_the_path_of_vehicles(style):
    town = small_town(style)
    world, outlines = build_world(town, seed=1), outline(town)
    xy = points_in(outlines.carriageway, 3000, inset=0.15)
    z, material = fall(world.mesh, xy, from_z=float(world.ground.bounds[1, 2]) + 60.0)
    origin = np.column_stack([xy, world.height(xy) + 3.2])  # under crowns and mast arms
    clearance, below = cast(world.mesh, origin, np.tile([0.0, 0.0, -1.0], (len(xy), 1)))
    assert {MATERIAL_NAMES[row] for row in set(below)} <= set(ROAD)
    np.testing.assert_allclose(clearance, 3.2, atol=0.02)
    assert np.isfinite(z).all() and len(material)


@pytest.mark.parametrize("style", sorted(STYLES))
def test_every_pane_sits_in_an_opening_with_a_dark_room_behind_it(style, outlines):
    rng = np.random.default_rng(4)
    plots = lay_out(outlines.paved, style_of(style), rng)
    houses = buildings_mesh(design(plots, style_of(style), lambda xy: slope(*xy.T), rng), rng)
    opaque, panes = houses.split_glass()
    middle = panes.triangles.mean(1)
    ranges, material = cast(opaque, middle, -panes.normals)
    assert (material == material_index("room_interior")).mean() > 0.99
    assert 0.2 < np.median(ranges) < 0.8
    in_front, _ = cast(opaque, middle + 0.3 * panes.normals, -panes.normals)  # no wall before the pane
    assert (in_front > 0.3).mean() > 0.99


def test_same_seed_same_bytes_other_seed_other_town_on_the_same_streets(streets, world):
    again, other = build_world(streets, seed=5), build_world(streets, seed=6)
    for own, theirs in ((world.mesh, again.mesh), (world.ground, again.ground)):
        assert own.vertices.tobytes() == theirs.vertices.tobytes()
        assert own.faces.tobytes() == theirs.faces.tobytes()
        assert own.materials.tobytes() == theirs.materials.tobytes()
    assert other.mesh.vertices.tobytes() != world.mesh.vertices.tobytes()
    assert other.ground.vertices.tobytes() == world.ground.vertices.tobytes()


def test_controlled_approaches_carry_their_signs(world):
    names = world.mesh.material_names()
    assert {"signal_lens", "sign_face", "sign_back", "road_marking", "foliage", "bark"} <= set(names)
    faces = of_materials(world.mesh, "sign_face")
    assert faces.triangles[:, :, 2].max() - slope(80, 80) < 6.0


def test_most_beams_of_a_64_beam_scanner_return_on_a_street(world):
    elevation = np.deg2rad(np.linspace(2.0, -24.8, 64))
    azimuth = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    el, az = (grid.ravel() for grid in np.meshgrid(elevation, azimuth, indexing="ij"))
    direction = np.column_stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    origin = np.array([40.0, -1.6, world.height(np.array([[40.0, -1.6]]))[0] + 1.73])
    ranges, _ = cast(world.mesh, np.tile(origin, (len(direction), 1)), direction)
    assert 0.7 < (ranges < 120.0).mean() < 0.99


def test_the_sheet_of_the_ground_is_one_piece_without_duplicate_faces(world):
    mesh = trimesh.Trimesh(world.ground.vertices, world.ground.faces, process=False)
    assert mesh.unique_faces().all()


def test_a_town_without_pavements_or_signs_has_a_whole_road(streets):
    lanes = tuple(lane for lane in streets.lanes if lane.use == "drive")
    bare = replace(streets, lanes=lanes, parking=(), stop_lines=())
    xy = points_in(outline(bare).carriageway, 1000)
    world = build_world(bare, seed=0)
    z, _ = fall(world.ground, xy)
    np.testing.assert_allclose(z, world.height(xy), atol=0.01)


def test_an_unknown_style_is_refused_by_name():
    with pytest.raises(ValueError, match="'baroque' is unknown; use one of village"):
        build_world(small_town("baroque"), seed=0)

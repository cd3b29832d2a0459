import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assets.materials import MATERIALS, material_index
from assets.mesh import Mesh
from sensors.bvh import Bvh
from sensors.hits import NOTHING, STATIC
from sensors.pattern import load_pattern
from sensors.point_cloud import bare_returns
from sensors.scene import Scene
from sensors.tracing import Tracer
from tests.sensors.worlds import block, instances, plane, pose, wall

HEIGHT_M = 1.73
LIDAR = pose(z=HEIGHT_M)


@pytest.fixture(scope="module")
def tracer():
    pattern = load_pattern("hdl64e")
    return Tracer(pattern.rays(), pattern.range_m)


def no_model(name):
    raise AssertionError(f"model {name} was not expected")


def test_level_ground_answers_at_height_over_sine(tracer):
    hits = tracer.trace(Scene(plane(), no_model), LIDAR, instances([]))
    down = -tracer.rays.direction[:, 2].astype(float)
    expected = np.divide(HEIGHT_M, down, out=np.full(len(down), np.inf), where=down > 0)
    seen = expected < 119.9
    assert np.abs(hits.solid.range_m[seen] - expected[seen]).max() < 1e-3
    assert (hits.solid.instance[seen] == STATIC).all()
    assert (hits.solid.instance[expected > 120.1] == NOTHING).all()
    np.testing.assert_allclose(hits.cos_incidence(hits.solid)[seen], down[seen], atol=1e-3)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_a_wall_answers_at_its_distance_over_the_cosine(tracer, yaw):
    hits = tracer.trace(Scene(wall(20.0, half_m=500), no_model), pose(yaw=yaw), instances([]))
    toward = tracer.rays.direction @ pose(yaw=yaw)[:3, :3].T[:, 0]
    seen = toward > 20 / 119.9
    assert np.abs(hits.solid.range_m[seen] - 20 / toward[seen]).max() < 1e-3
    assert (hits.solid.instance[toward < 20 / 120.1] == NOTHING).all()


def test_nothing_nearer_than_the_nearest_range_answers(tracer):
    near_and_far = Mesh.merge([wall(0.5), wall(30.0)])
    hits = tracer.trace(Scene(near_and_far, no_model), np.eye(4), instances([]))
    forward = tracer.rays.direction[:, 0] > 0.9
    assert (hits.solid.range_m[forward] > 29).all()


def test_culling_by_windows_finds_what_one_merged_mesh_finds(tracer):
    rng = np.random.default_rng(5)
    car = block((4.0, 1.7, 1.5))
    poses = [pose(*rng.uniform(-60, 60, 2), 0, rng.uniform(-4, 4)) for _ in range(40)]
    poses += [pose(-5.0, 0.1), pose(-8.0, 0.0, 0, np.pi), pose(3.0, -0.4, 0, 0.3)]
    tilt = pose(1.0, 2.0, HEIGHT_M, 2.0)
    tilt[:3, :3] = tilt[:3, :3] @ np.array([[0.999, 0, 0.0447], [0, 1, 0], [-0.0447, 0, 0.999]])
    placed = instances(poses)
    hits = tracer.trace(Scene(plane(), lambda name: car), tilt, placed)
    merged = Bvh(Mesh.merge([plane(), *(car.transformed(p) for p in poses)]))
    direction = (tracer.rays.direction @ tilt[:3, :3].T).astype(np.float32)
    origin = (tilt[:3, 3] + direction * 0.9).astype(np.float32)
    distance, triangle = merged.first_hit(origin, direction, np.full(len(origin), 119.1, np.float32))
    expected = np.where(triangle >= 0, distance + 0.9, np.inf)
    both = np.isfinite(expected) & np.isfinite(hits.solid.range_m)
    assert (np.isfinite(expected) == np.isfinite(hits.solid.range_m)).all()
    # Edges of boxes are met to one side or the other by float32's last digit.
    assert np.mean(np.abs(expected[both] - hits.solid.range_m[both]) > 1e-3) < 1e-4


@settings(max_examples=40, deadline=None)
@given(
    x=st.floats(-80, 80),
    y=st.floats(-80, 80),
    yaw=st.floats(-3.1, 3.1),
    scale=st.tuples(st.floats(0.5, 2), st.floats(0.5, 2), st.floats(0.5, 2)),
)
def test_a_scaled_instance_is_met_where_its_scaled_mesh_stands(tracer, x, y, yaw, scale):
    car = block((4.0, 1.7, 1.5))
    placed = instances([pose(x, y, -1.0, yaw)])
    placed.scales[:] = scale
    hits = tracer.trace(Scene(Mesh.empty(), lambda name: car), np.eye(4), placed)
    stretched = Mesh(car.vertices * np.array(scale), car.faces, car.materials).transformed(placed.poses[0])
    origin = (tracer.rays.direction * 0.9).astype(np.float32)
    limit = np.full(len(origin), 119.1, np.float32)
    distance, triangle = Bvh(stretched).first_hit(origin, tracer.rays.direction, limit)
    expected = triangle >= 0
    assert np.count_nonzero(expected != hits.solid.exists) <= 2 + expected.sum() // 500
    both = expected & hits.solid.exists
    assert np.mean(np.abs(distance[both] + 0.9 - hits.solid.range_m[both]) > 2e-3) <= 0.005 if both.any() else True


def test_glass_is_kept_apart_from_what_stands_behind_it(tracer):
    panes = Mesh.merge([wall(9.0, "car_glass"), wall(10.0, "window_glass"), wall(15.0)])
    hits = tracer.trace(Scene(panes, no_model), np.eye(4), instances([]))
    toward = tracer.rays.direction[:, 0].astype(float)
    straight = np.flatnonzero((toward > 0.95) & (np.abs(tracer.rays.direction[:, 1]) < 0.2))
    assert np.isin(straight, hits.pane_beam).all()
    np.testing.assert_allclose(hits.solid.range_m[straight], 15 / toward[straight], atol=2e-3)
    np.testing.assert_allclose(hits.first.range_m[straight], 9 / toward[straight], atol=1e-3)
    assert (hits.first.material[straight] == material_index("car_glass")).all()
    assert (hits.solid.material[straight] == material_index("concrete")).all()


def test_glass_of_an_instance_lets_the_world_behind_answer(tracer):
    pane = wall(0.0, "car_glass", half_m=1.0)
    world = Scene(wall(20.0), lambda name: pane)
    hits = tracer.trace(world, np.eye(4), instances([pose(10.0)]))
    assert len(hits.pane_beam) > 500
    assert (hits.pane.instance == 0).all()
    np.testing.assert_allclose(hits.solid.range_m[hits.pane_beam], 2 * hits.pane.range_m, atol=3e-3)
    assert (hits.solid.instance[hits.pane_beam] == STATIC).all()


def test_glass_behind_something_solid_is_not_reported(tracer):
    hits = tracer.trace(Scene(Mesh.merge([wall(9.0), wall(10.0, "car_glass")]), no_model), np.eye(4), instances([]))
    ahead = tracer.rays.direction[hits.pane_beam, 0]
    assert not (ahead > 0.5).any()


def test_the_bare_sensor_reports_reflectance_and_paint(tracer):
    car = block((4.0, 1.7, 1.5))
    hits = tracer.trace(Scene(plane(), lambda name: car), LIDAR, instances([pose(10.0)], paint=0.37))
    cloud = bare_returns(hits)
    on_car = cloud.instance == 0
    assert on_car.sum() > 500
    assert cloud.intensity[on_car] == pytest.approx(0.37)
    assert cloud.intensity[~on_car] == pytest.approx(MATERIALS["asphalt"].reflectance)
    world = cloud.xyz + np.array([0, 0, HEIGHT_M])
    assert np.abs(world[~on_car, 2]).max() < 2e-3
    assert world[on_car, 0].min() == pytest.approx(8.0, abs=2e-3)


def test_points_keep_the_order_of_their_beams(tracer):
    cloud = bare_returns(tracer.trace(Scene(plane(), no_model), LIDAR, instances([])))
    assert (np.diff(cloud.ring.astype(int)) >= 0).all()
    for ring in (20, 63):
        assert (np.diff(cloud.azimuth[cloud.ring == ring]) < 0).all()
    np.testing.assert_allclose(np.arctan2(cloud.xyz[:, 1], cloud.xyz[:, 0]), cloud.azimuth, atol=1e-5)


def test_a_car_twice_as_far_takes_a_quarter_of_the_beams(tracer):
    car = block((4.0, 1.7, 1.5))
    counts = []
    for distance in (15.0, 30.0):
        hits = tracer.trace(Scene(Mesh.empty(), lambda name: car), LIDAR, instances([pose(distance)]))
        counts.append(np.count_nonzero(hits.solid.instance == 0))
    assert counts[0] / counts[1] == pytest.approx(4, rel=0.25)


def test_more_worlds_can_be_held_than_a_thread_has_keys():
    worlds = [Bvh(wall(1.0 + number)) for number in range(1100)]
    ahead = np.array([[1, 0, 0]], np.float32)
    distance, _ = worlds[-1].first_hit(np.zeros((1, 3), np.float32), ahead, np.array([2000], np.float32))
    assert distance[0] == pytest.approx(1100.0)


def test_a_ray_is_blocked_where_it_hits_something_within_its_reach():
    rng = np.random.default_rng(0)
    mesh = Mesh.merge([plane(), wall(5.0), wall(9.0)])
    origin = rng.uniform((-3, -3, 0.1), (12, 3, 3), (5000, 3)).astype(np.float32)
    direction = rng.normal(size=(5000, 3))
    direction = (direction / np.linalg.norm(direction, axis=1, keepdims=True)).astype(np.float32)
    bvh = Bvh(mesh)
    for reach_m in (0.5, 5.0, 100.0):
        _, triangle = bvh.first_hit(origin, direction, np.full(len(origin), reach_m, np.float32))
        assert 0 < (triangle >= 0).sum() < len(origin)
        assert np.array_equal(bvh.blocks(origin, direction, reach_m), triangle >= 0)
    assert not Bvh(Mesh.empty()).blocks(origin, direction, 5.0).any()

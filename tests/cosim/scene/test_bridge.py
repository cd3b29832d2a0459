import numpy as np
import pytest

from assets import CATALOGUE, Mesh, build_model
from assets.world.groundwork import lay_groundwork
from cosim.scene.bridge import Bridge, models_of_size
from cosim.scene.ground import Ground
from tests.assets.small_town import small_town
from tests.cosim.road_users import road_users


def slope(along: float, across: float) -> Mesh:
    """A plane rising by `along` to the east and `across` to the north."""
    xy = np.array([[-100, -100], [100, -100], [100, 100], [-100, 100]], float)
    z = xy @ np.array([along, across])
    return Mesh.of(np.column_stack([xy, z]), np.array([[0, 1, 2], [0, 2, 3]]), "asphalt")


def one_of_each(heading=0.3, rise=(0.0, 0.0)):
    """One actor of every body, on a plane that rises by `rise` to the east and north."""
    specs = [next(spec for spec in CATALOGUE.values() if spec.body == body) for body in sorted(_bodies())]
    front = [[x, 3.0, x * rise[0] + 3.0 * rise[1]] for x in 7.0 * np.arange(len(specs)) - 35]
    return specs, road_users(
        [spec.kind for spec in specs], front, sizes=[spec.size_m for spec in specs], heading_rad=heading
    )


def _bodies():
    return {spec.body for spec in CATALOGUE.values() if spec.kind != "person_sitting"}  # they are not in the traffic


def test_every_actor_gets_a_mesh_of_exactly_its_vtypes_size():
    _, row = one_of_each()
    placed = Bridge(Ground(slope(0, 0)), seed=1).place(row)
    for i, name in enumerate(placed.models):
        box = build_model(name).bounds * placed.scales[i]
        np.testing.assert_allclose(box[1] - box[0], row.size[i], atol=1e-6)


@pytest.mark.parametrize("kind", sorted({spec.kind for spec in CATALOGUE.values()}))
def test_a_size_outside_the_catalogue_is_met_by_scaling(kind):
    size = [3.31, 1.23, 1.61]
    placed = Bridge(Ground(slope(0, 0)), seed=1).place(road_users([kind], [[0, 0, 0]], sizes=[size]))
    box = build_model(placed.models[0]).bounds * placed.scales[0]
    np.testing.assert_allclose(box[1] - box[0], size, atol=1e-6)


def test_the_front_bumper_is_where_sumo_says():
    _, row = one_of_each(heading=0.8)
    placed = Bridge(Ground(slope(0, 0)), seed=1).place(row)
    for i, kind in enumerate(row.kinds):
        ahead = 0 if kind == "pedestrian" else row.size[i, 0] / 2
        np.testing.assert_allclose((placed.poses[i] @ [ahead, 0, 0, 1])[:2], row.front[i, :2], atol=1e-6)


@pytest.mark.parametrize(("along", "across"), [(0.08, 0.0), (-0.05, 0.03), (0.0, 0.06)])
def test_wheels_touch_a_sloping_road(along, across):
    specs, row = one_of_each(rise=(along, across))
    placed = Bridge(Ground(slope(along, across)), seed=1).place(row)
    for i, spec in enumerate(specs):
        if spec.kind == "pedestrian":
            assert placed.poses[i, 2, 2] == pytest.approx(1)
            continue
        for x in (spec.front_axle_x_m, spec.rear_axle_x_m):
            for y in (spec.track_m / 2, -spec.track_m / 2):
                wheel = placed.poses[i] @ [x, y, 0, 1]
                assert wheel[2] == pytest.approx(wheel[:2] @ [along, across], abs=5e-3)


def test_poses_are_rotations():
    _, row = one_of_each(rise=(0.08, -0.04))
    placed = Bridge(Ground(slope(0.08, -0.04)), seed=1).place(row)
    turned = placed.poses[:, :3, :3]
    np.testing.assert_allclose(turned @ turned.transpose(0, 2, 1), np.tile(np.eye(3), (len(row), 1, 1)), atol=1e-9)
    assert (np.linalg.det(turned) > 0).all()


def test_uphill_lifts_the_nose():
    _, row = one_of_each(heading=0.0, rise=(0.08, 0))
    placed = Bridge(Ground(slope(0.08, 0)), seed=1).place(row)
    drives = np.array([kind != "pedestrian" for kind in row.kinds])
    assert np.allclose(placed.poses[drives, 2, 0], np.sin(np.arctan(0.08)), atol=1e-6)


def test_appearances_are_constant_and_follow_the_seed():
    sizes = np.tile(CATALOGUE["hatchback_01"].size_m, (60, 1))
    many = road_users(["car"] * 60, np.zeros((60, 3)), sizes=sizes)
    first = Bridge(Ground(slope(0, 0)), seed=1)
    a, b = first.place(many), first.place(many)
    other = Bridge(Ground(slope(0, 0)), seed=2).place(many)
    assert a.models == b.models and (a.paint == b.paint).all()
    assert a.models != other.models and (a.paint != other.paint).any()
    assert set(a.models) == {spec.name for spec in models_of_size("car", np.array(sizes[0]))}
    assert len(set(a.models)) > 1


def test_velocity_follows_the_road():
    _, row = one_of_each(heading=0.0, rise=(0.06, 0))
    moving = road_users(row.kinds, row.front, sizes=row.size, heading_rad=row.heading_rad, speed_mps=10.0)
    placed = Bridge(Ground(slope(0.06, 0)), seed=1).place(moving)
    np.testing.assert_allclose(np.linalg.norm(placed.velocity_mps, axis=1), 10)
    drives = np.array([kind != "pedestrian" for kind in row.kinds])
    assert np.allclose(placed.velocity_mps[drives, 2], 10 * np.sin(np.arctan(0.06)), atol=1e-5)


def test_wheels_and_feet_rest_on_uneven_ground():
    base = lay_groundwork(small_town())
    ground, x = Ground(base.ground), np.linspace(-70.0, 70.0, 29)
    position = np.column_stack([x, np.full(29, 1.6), base.height(np.column_stack([x, np.full(29, 1.6)]))])
    for kind in ("car", "pedestrian"):
        size = next(spec.size_m for spec in CATALOGUE.values() if spec.kind == kind)
        row = road_users([kind] * 29, position.tolist(), sizes=[size] * 29)
        placed = Bridge(ground, seed=1).place(row)
        for i, name in enumerate(placed.models):
            spec = CATALOGUE[name]
            across = spec.track_m / 2 * placed.scales[i, 1]
            along = np.array([spec.front_axle_x_m, spec.rear_axle_x_m]) * placed.scales[i, 0] if across else [0.0]
            wheels = np.array([placed.poses[i] @ [a, b, 0, 1] for a in along for b in (across, -across)])
            over = wheels[:, 2] - ground.height(wheels[:, :3])
            assert np.abs(over).max() < 0.04 and abs(over.mean()) < 0.01

"""Windows, façades and wet roads: which surface answers, and where."""

import numpy as np
import pytest

from assets.materials import MATERIALS, material_index
from assets.mesh import Mesh
from assets.shapes import box
from sensors.hits import NOTHING
from sensors.scene import Scene
from tests.sensors.effects.scenes import effect, no_model, of_hits, sensor, shoot
from tests.sensors.worlds import plane, pose, wall

BEHIND = Scene(Mesh.merge([wall(10.0, "window_glass"), wall(20.0)]), no_model)


def glass(mode, transmission, scene=BEHIND):
    return of_hits(sensor(effect("glass_transmission", transmission=transmission, mode=mode)), scene, pose=np.eye(4))


def ahead(returns, shot):
    return shot.rays.direction[returns.beam, 0] > 0.5


def test_last_reports_what_stands_behind_after_two_way_loss():
    returns, shot = glass("last", 0.7)
    seen = ahead(returns, shot)
    toward = shot.rays.direction[returns.beam[seen], 0]
    np.testing.assert_allclose(returns.range_m[seen], 20 / toward, atol=2e-3)
    assert returns.intensity[seen] == pytest.approx(0.4 * 0.49, abs=1e-5)


def test_first_reports_the_pane():
    returns, shot = glass("first", 0.7)
    seen = ahead(returns, shot)
    toward = shot.rays.direction[returns.beam[seen], 0]
    np.testing.assert_allclose(returns.range_m[seen], 10 / toward, atol=1e-3)
    np.testing.assert_allclose(returns.intensity[seen], 0.3 * toward, atol=1e-3)


@pytest.mark.parametrize(("transmission", "material"), [(0.9, "concrete"), (0.3, "window_glass")])
def test_strongest_reports_the_larger(transmission, material):
    returns, shot = glass("strongest", transmission)
    front = shot.rays.direction[returns.beam, 0] > 0.9
    assert (returns.material[front] == material_index(material)).all()


def test_dual_returns_report_both_the_stronger_first():
    returns, shot = glass("dual", 0.7)
    seen = ahead(returns, shot)
    beam, count = np.unique(returns.beam[seen], return_counts=True)
    assert (count == 2).all() and (np.diff(returns.beam) >= 0).all()
    first, second = (returns.take(seen & (returns.return_no == number)) for number in (0, 1))
    np.testing.assert_array_equal(first.beam, beam)
    assert (first.intensity >= second.intensity).all()


def test_a_pane_before_the_sky_answers_only_for_itself():
    alone = Scene(wall(10.0, "window_glass"), no_model)
    for mode in ("first", "strongest", "last", "dual"):
        returns, shot = glass(mode, 0.7, alone)
        assert len(returns) > 1000 and (returns.return_no == 0).all()
        np.testing.assert_allclose(returns.intensity, 0.3 * shot.rays.direction[returns.beam, 0], atol=1e-3)
    assert len(glass("last", 1.0, alone)[0]) == 0


def test_a_car_seen_through_both_side_windows_returns_what_is_behind_it():
    window = Mesh.merge([box((3, 0.01, 1), (0, y, 1.2), "car_glass") for y in (-0.8, 0.8)])
    scene = Scene(Mesh.merge([window.moved((0, 6, 0)), box((60, 0.2, 8), (0, 12, 4), "brick")]), no_model)
    returns, shot = of_hits(
        sensor(effect("glass_transmission", transmission=0.9, mode="last")), scene, pose=pose(z=1.2)
    )
    through = np.isin(returns.beam, shot.panes.beam)
    assert through.sum() > 1000
    y = shot.rays.direction[returns.beam[through], 1] * returns.range_m[through]
    np.testing.assert_allclose(y, 11.9, atol=2e-3)


def test_a_metal_wall_shows_the_scene_at_the_folded_range():
    """The sensor faces a mirror 10 m ahead, with a wall 5 m behind it: the ghost is at 25 m."""
    scene = Scene(Mesh.merge([wall(10.0, "cladding_metal"), wall(-5.0)]), no_model)
    returns, shot = shoot(sensor(effect("mirror_ghost", strength=1.0)), scene, pose=np.eye(4))
    seen = shot.rays.direction[returns.beam, 0] > 0.5
    assert seen.sum() > 1000
    np.testing.assert_allclose(returns.range_m[seen], 25 / shot.rays.direction[returns.beam[seen], 0], rtol=2e-4)
    assert (returns.instance[seen] == NOTHING).all()
    assert returns.intensity[seen] == pytest.approx(0.4)


@pytest.mark.parametrize("strength", [0.1, 0.6])
def test_strength_is_the_share_of_mirrored_beams(strength):
    scene = Scene(Mesh.merge([wall(10.0, "window_glass"), wall(30.0), wall(-5.0)]), no_model)
    returns, shot = shoot(sensor(effect("mirror_ghost", strength=strength)), scene, pose=np.eye(4))
    front = shot.rays.direction[returns.beam, 0] > 0.5
    assert np.mean(returns.instance[front] == NOTHING) == pytest.approx(strength, abs=0.02)


def test_a_film_of_water_darkens_the_road_and_swallows_grazing_beams():
    scene = Scene(plane(), no_model)
    bare, _ = shoot(sensor(), scene)
    wet, shot = shoot(sensor(effect("wet_road", film=0.8)), scene)
    assert wet.intensity == pytest.approx(MATERIALS["asphalt"].reflectance * 0.6, abs=1e-5)
    lost = ~np.isin(bare.beam, wet.beam)
    cos = shot.cos_incidence(bare)
    f0 = (0.33 / 2.33) ** 2
    chance = 0.8 * (f0 + (1 - f0) * (1 - cos) ** 5)
    for low, high in ((0.02, 0.05), (0.1, 0.2), (0.3, 0.5)):
        band = (cos > low) & (cos < high)
        assert lost[band].mean() == pytest.approx(chance[band].mean(), abs=0.02)


def test_reflections_in_a_wet_road_stand_below_ground():
    scene = Scene(Mesh.merge([plane(), wall(20.0, half_m=20)]), no_model)
    wet, shot = shoot(sensor(effect("wet_road", film=1.0)), scene)
    ghost = wet.instance == NOTHING
    assert ghost.sum() > 100
    points = shot.rays.direction[wet.beam[ghost]] * wet.range_m[ghost][:, None]
    # The mirror image of the wall: same distance ahead, below the road.
    np.testing.assert_allclose(points[:, 0], 20, atol=0.02)
    assert (points[:, 2] < -1.73).all()

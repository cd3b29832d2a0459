"""Beams of some width: mixed pixels at edges, clean ones elsewhere."""

import numpy as np
import pytest

from assets.materials import MATERIAL_NAMES, MATERIALS
from assets.mesh import Mesh
from assets.shapes import box
from sensors.effects.surfaces.footprint import strongest_echo
from sensors.hits import STATIC, Hits, Surface
from sensors.normals import encode_normals
from sensors.scene import Scene
from sensors.shot import returns_of
from tests.sensors.effects.scenes import dense, effect, no_model, sensor, shoot
from tests.sensors.worlds import plane, wall

BEAMS = 64 * 2083


def screen_before_wall(gap_m):
    """A board of 2 × 4 m at 10 m, a wall behind it."""
    return Scene(Mesh.merge([box((0.01, 2, 4), (10, 0, 0), "concrete"), wall(10 + gap_m)]), no_model)


def measured(scene, pulse_ns, divergence=4.0):
    wide = effect("beam_divergence", divergence_mrad=divergence, pulse_ns=pulse_ns)
    returns, shot = shoot(sensor(wide), scene, pose=np.eye(4))
    x = shot.rays.direction[returns.beam, 0] * returns.range_m
    return returns, x, shot.rays.direction[returns.beam, 0] > 0.9


def test_edges_closer_than_half_a_pulse_merge_to_mixed_pixels():
    _, x, ahead = measured(screen_before_wall(0.5), pulse_ns=10)
    mixed = ahead & (x > 10.03) & (x < 10.47)
    assert mixed.sum() > 20
    # In between, by the share of the footprint: multiples of 1/16.
    shares = (x[mixed] - 10) / 0.505
    assert shares.min() > 0.1 and shares.max() < 0.9


def test_edges_farther_apart_give_one_or_the_other():
    returns, x, ahead = measured(screen_before_wall(5.0), pulse_ns=10)
    assert not (ahead & (x > 10.05) & (x < 14.9)).any()
    partly = ahead & (returns.intensity < 0.39)
    assert partly.sum() > 20, "a footprint that a surface fills in part returns in part"


def test_flat_surfaces_answer_as_a_thin_beam_does():
    for scene, atol in ((Scene(wall(20.0, half_m=300), no_model), 2e-3), (Scene(plane(), no_model), 0.02)):
        from tests.sensors.effects.scenes import LIDAR

        thin = dense(shoot(sensor(), scene, pose=LIDAR)[0], BEAMS)
        wide_effect = effect("beam_divergence", divergence_mrad=2.0, pulse_ns=6.0)
        returns, _ = shoot(sensor(wide_effect), scene, pose=LIDAR)
        wide = dense(returns, BEAMS)
        near = np.isfinite(thin) & np.isfinite(wide) & (thin < 40)
        np.testing.assert_allclose(wide[near], thin[near], atol=atol, rtol=1e-3)
        material = "concrete" if atol < 0.01 else "asphalt"
        expected = MATERIALS[material].reflectance
        assert dense(returns, BEAMS, "intensity")[near] == pytest.approx(expected, abs=1e-4)


def test_parts_that_meet_nothing_have_no_signal():
    """Whatever material they are left with: a sample that is bent off its plane keeps that plane's."""
    codes = encode_normals(np.tile(np.array([[-1.0, 0, 0]], np.float32), (4, 1)))
    bright, dark = (np.uint8(MATERIAL_NAMES.index(name)) for name in ("plaster_white", "asphalt"))

    def hits(ranges: list[float], material: np.uint8) -> Hits:
        rows = len(ranges)
        reach, instance = np.array(ranges, np.float32), np.full(rows, STATIC, np.int16)
        solid = Surface(reach, codes[:rows], np.full(rows, material), instance)
        none = solid.take(np.zeros(0, int))
        return Hits(None, np.eye(4), solid, np.zeros(0, np.int32), none, np.zeros(0, np.float32))  # type: ignore[arg-type]

    middle = hits([np.inf], bright)
    found = strongest_echo(returns_of(middle), middle, hits([10.0, 14.0, 14.0, np.inf], dark), pulse_m=0.9)
    assert found.range_m == pytest.approx([14.0])

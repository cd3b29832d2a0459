"""Scans thinned to KITTI's resolution, and the depth camera that is thinned before it is traced."""

import numpy as np
import pytest

from assets.mesh import Mesh
from sensors.errors import SensorError
from sensors.pattern import load_pattern, parse_pattern
from sensors.scene import Scene
from sensors.sensor_model import SensorModel, load_sensor
from tests.sensors.effects.scenes import effect, no_model, of_hits, room, sensor
from tests.sensors.worlds import plane, wall

CELL_DEG = (0.16, 0.30)


def angles(rays, beam=slice(None)):
    x, y, z = rays.direction[beam].astype(float).T
    return np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(z))


def dense_pattern():
    finer = np.round(np.linspace(2.0, -24.8, 250), 4).tolist()
    return load_pattern("hdl64e").model_copy(
        update={
            "name": "dense",
            "firings": 4000,
            "elevation_deg": tuple(finer),
            "azimuth_offset_deg": (0,) * 250,
            "block": (0,) * 250,
        }
    )


@pytest.fixture(scope="module")
def thinned():
    thin = effect("angular_downsampling", azimuth_deg=CELL_DEG[0], elevation_deg=CELL_DEG[1], field="all")
    return of_hits(sensor(thin, pattern=dense_pattern()), room())


def test_a_cell_keeps_one_return_and_no_cell_is_emptied(thinned):
    returns, shot = thinned
    azimuth, elevation = angles(shot.rays, returns.beam)
    cells = set(zip(np.floor(azimuth / 0.16), np.floor(elevation / 0.30), strict=True))
    assert len(cells) == len(returns)
    every = angles(shot.rays)
    assert len(cells) == len(set(zip(np.floor(every[0] / 0.16), np.floor(every[1] / 0.30), strict=True)))


def test_the_image_field_keeps_what_the_camera_shows():
    thin = effect("angular_downsampling", azimuth_deg=0.16, elevation_deg=0.30, field="image")
    returns, shot = of_hits(sensor(thin), room())
    azimuth, _ = angles(shot.rays, returns.beam)
    assert 36 < azimuth.max() < 42 and -42 < azimuth.min() < -36  # 1242 px at 721.5 px are 81 degrees


def test_the_depth_camera_s_beams_are_pixels_one_a_cell():
    pattern = load_pattern("depth_camera")
    rays = pattern.rays()
    focal = 1024 / np.tan(np.radians(60))
    x, y, z = rays.direction.astype(float).T
    for pixel in (1023.5 - focal * y / x, 255.5 - focal * z / x):
        np.testing.assert_allclose(pixel, np.rint(pixel), atol=2e-3)
    azimuth, elevation = angles(rays)
    assert np.abs(azimuth).max() < 60 and elevation.min() > -23.4 and elevation.max() < 2.0
    cells = set(zip(np.floor((60 - azimuth) / 0.16 - 1e-6), rays.ring, strict=True))
    assert len(cells) >= 0.999 * len(rays)
    assert (np.diff(rays.ring.astype(int)) >= 0).all() and not rays.time_s.any()


def test_it_sees_through_glass_and_measures_true_distances():
    world = Scene(Mesh.merge([wall(10.0, "window_glass"), wall(20.0), plane(-1.73)]), no_model)
    returns, shot = of_hits(SensorModel(load_pattern("depth_camera")), world, pose=np.eye(4))
    level = shot.rays.direction[returns.beam, 2] > 0
    np.testing.assert_allclose(returns.range_m[level] * shot.rays.direction[returns.beam[level], 0], 20, atol=2e-3)


def test_a_depth_camera_survives_its_file():
    pattern = load_pattern("depth_camera")
    assert parse_pattern(pattern.to_yaml(), origin="copy") == pattern


@pytest.mark.parametrize(
    ("line", "complaint"),
    [("cell_deg: [0.16, 0.05]", "elevation_deg"), ("cell_deg: [0, 0.3]", "cell_deg"), ("fov_deg: 180", "fov_deg")],
)
def test_a_faulty_depth_camera_is_refused_in_one_line(line, complaint):
    key = line.partition(":")[0]
    text = load_pattern("depth_camera").to_yaml().splitlines()
    # Lists of one line are below their key.
    kept = [row for row in text if not row.startswith(key)]
    with pytest.raises(SensorError, match=complaint) as caught:
        parse_pattern("\n".join([*kept, line]), origin="mine.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("one", "other", "differs"),
    [
        ("strongest", "strongest_star", {"box_shrink"}),
        ("dual", "noise", {"range_noise"}),
        ("noise", "intensity", {"projected_intensity", "linear_falloff", "intensity_jitter"}),
        ("intensity", "raydrop", {"intensity_cutoff"}),
    ],
)
def test_each_variant_adds_one_thing_to_the_one_before(one, other, differs):
    first, second = load_sensor(one), load_sensor(other)
    assert first.pattern == second.pattern
    assert {effect.name for effect in set(first.effects) ^ set(second.effects)} == differs


def test_first_hit_meets_the_pane_and_strongest_what_is_behind():
    world = Scene(Mesh.merge([wall(10.0, "window_glass"), wall(20.0)]), no_model)
    ranges = {}
    for name in ("first_hit", "strongest"):
        returns, shot = of_hits(load_sensor(name), world, pose=np.eye(4))
        ahead = shot.rays.direction[returns.beam, 0] > 0.9
        ranges[name] = np.median(returns.range_m[ahead] * shot.rays.direction[returns.beam[ahead], 0])
    assert ranges == pytest.approx({"first_hit": 10.0, "strongest": 20.0}, abs=2e-3)

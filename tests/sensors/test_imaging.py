"""Exposure doubles light a stop, corners lose theirs, blur keeps it, and noise has the variance of electrons."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial import KDTree

from assets.materials import material_index
from sensors.cameras.cast_shadows import world_points
from sensors.cameras.images import Images
from sensors.cameras.imaging import Imaging
from sensors.cameras.texture import fields_of, textured
from sensors.sensor_model import load_sensor
from tests.sensors.worlds import instances


def gray(level: int, shape: tuple[int, int] = (200, 300)) -> Images:
    return Images(
        0.2, np.full((*shape, 4), level, np.uint8), np.ones(shape, np.uint16), np.full(shape, 0.02, np.float32)
    )


def light(images: Images) -> np.ndarray:
    """Linear light by pixel."""
    return np.square(images.rgb[..., 1].astype(float) / 255)


def rng() -> np.random.Generator:
    return np.random.default_rng(1)


def test_by_default_nothing_happens():
    images = gray(100)
    assert Imaging().seen(images, rng()) is images


@pytest.mark.parametrize("stops", [-2.0, -0.5, 1.0])
def test_a_stop_doubles_the_light(stops):
    before, after = gray(120), Imaging(exposure_ev=stops).seen(gray(120), rng())
    assert light(after).mean() == pytest.approx(light(before).mean() * 2**stops, rel=0.01)
    assert after.rgba is not None and (after.rgba[..., 3] == 120).all()  # the material's number stays


def test_overexposure_saturates():
    assert (Imaging(exposure_ev=4).seen(gray(120), rng()).rgb == 255).all()


def test_corners_lack_what_is_said():
    found = light(Imaging(vignetting=0.4).seen(gray(200), rng()))
    middle = found[95:105, 145:155].mean()
    assert found[0, 0] == pytest.approx(0.6 * middle, rel=0.02) and found[0, -1] == pytest.approx(found[-1, 0])


def test_blur_spreads_light_and_keeps_it():
    images = gray(0)
    assert images.rgba is not None
    images.rgba[100, 150, :3] = 255
    found = light(Imaging(blur_px=2.0).seen(images, rng()))
    assert found.max() < 0.1 and found[100, 152] == pytest.approx(found[102, 150], rel=0.05)


@pytest.mark.parametrize(("level", "read_noise_e"), [(180, 0.0), (120, 0.0), (120, 60.0)])
def test_noise_has_the_variance_of_its_electrons(level, read_noise_e):
    full_well_e = 2000.0
    found = light(Imaging(full_well_e=full_well_e, read_noise_e=read_noise_e).seen(gray(level), rng())) * full_well_e
    electrons = (level / 255) ** 2 * full_well_e
    assert found.mean() == pytest.approx(electrons, rel=0.01)
    assert found.var() == pytest.approx(electrons + read_noise_e**2, rel=0.06)


def test_the_same_generator_gives_the_same_noise():
    noisy = Imaging(full_well_e=1000)
    assert np.array_equal(noisy.seen(gray(90), rng()).rgb, noisy.seen(gray(90), rng()).rgb)


def test_only_the_sky_gets_brighter():
    images = gray(60)
    assert images.rgba is not None
    images.rgba[:50, :, 3] = 0
    found = light(Imaging(sky=4.0).seen(images, rng()))
    assert found[:50].mean() == pytest.approx(4 * found[50:].mean(), rel=0.02)
    assert found[50:].mean() == pytest.approx((60 / 255) ** 2, rel=1e-6)


FIELDS = fields_of(load_sensor("kitti"))
P = np.array([[200.0, 0, 150, 0], [0, 200.0, 100, 0], [0, 0, 1, 0]])
AHEAD = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.5], [0, 0, 0, 1]])  # world from camera


def ground(material: str = "asphalt") -> Images:
    """A level surface below a camera at 1.5 m that looks along x, below the horizon."""
    images = gray(100)
    assert images.rgba is not None and images.inverse_depth is not None
    images.rgba[..., 3] = 0
    images.rgba[110:, :, 3] = material_index(material) + 1
    depth = 1.5 * 200 / (np.arange(110, 200) - 100)
    images.inverse_depth[:] = 0
    images.inverse_depth[110:] = images.near_m / depth[:, None]
    return Images(images.near_m, images.rgba, np.zeros((200, 300), np.uint16), images.inverse_depth)


def test_structure_stays_on_the_ground_when_the_camera_moves():
    """The light at a place is the same from two positions, and the sky has no structure."""
    moved = AHEAD.copy()
    moved[0, 3] = 0.6
    nobody = instances([])
    places, values = [], []
    for pose in (AHEAD, moved):
        rows, columns = np.nonzero(ground().depth_m > 0)
        depth = ground().depth_at(rows, columns)
        near = depth < 4
        places.append(world_points(rows[near], columns[near], depth[near], pose, P))
        values.append(np.log(light(textured(ground(), 1.0, pose, P, nobody, FIELDS))[rows[near], columns[near]]))
    gap, other = KDTree(places[0]).query(places[1])
    same = gap < 0.004
    assert same.sum() > 100
    assert np.corrcoef(values[0][other[same]], values[1][same])[0, 1] > 0.6
    assert 0.1 < values[0].std() < 0.4
    assert np.ptp(light(textured(ground(), 1.0, AHEAD, P, nobody, FIELDS))[:110]) == 0  # the sky has none
    images = ground()
    assert textured(images, 0.0, AHEAD, P, nobody, FIELDS) is images


def test_values_have_bounds():
    for values in ({"vignetting": 1.5}, {"full_well_e": 0}, {"blur_px": -1}, {"iso": 400}):
        with pytest.raises(ValidationError):
            Imaging.model_validate(values)

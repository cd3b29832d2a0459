"""Exposure doubles light a stop, corners lose theirs, blur keeps it, and noise has the variance of electrons."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from sensors.cameras.images import Images
from sensors.cameras.imaging import Imaging


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


def test_values_have_bounds():
    for values in ({"vignetting": 1.5}, {"full_well_e": 0}, {"blur_px": -1}, {"iso": 400}):
        with pytest.raises(ValidationError):
            Imaging.model_validate(values)

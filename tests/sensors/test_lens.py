"""A lens bends the image of a pinhole, and taking the bend out again gives the pinhole's."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from sensors.cameras.images import Images
from sensors.cameras.lens import Distortion, Lens, undistorted

K = np.array([[400.0, 0, 319.5], [0, 410.0, 239.5], [0, 0, 1]])
SIZE = (640, 480)
LENSES = [
    Distortion(coefficients=(-0.25, 0.06, 0.001, -0.0005, 0.0)),
    Distortion(coefficients=(0.08, 0.0, 0.0, 0.0)),
    Distortion(model="fisheye", coefficients=(-0.02, 0.003, 0.0, 0.0)),
]


def board(lens: Lens) -> Images:
    """What the pinhole sees of a wall with squares of 0.05 tan, numbered by row and column."""
    width, height = lens.source_size
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    P = lens.source_projection
    x, y = (u - P[0, 2]) / P[0, 0], (v - P[1, 2]) / P[1, 1]
    number = (100 * np.floor(y / 0.05).astype(int) + np.floor(x / 0.05).astype(int) + 5000).astype(np.uint16)
    gray = ((number % 2) * 155 + 50).astype(np.uint8)
    return Images(0.2, np.dstack([gray] * 4), number, np.full((height, width), 0.02, np.float32))


@pytest.mark.parametrize("distortion", LENSES)
def test_a_point_of_the_wall_is_where_the_lens_puts_it(distortion):
    lens = Lens.of(K, *SIZE, distortion)
    seen = lens.bent(board(lens)).number
    assert seen is not None and seen.shape == (SIZE[1], SIZE[0])
    middles = np.array([[0.05 * i + 0.025, 0.05 * j + 0.025, 1.0] for i in range(-10, 10) for j in range(-8, 8)])
    pixels, _ = distortion.pixels(middles * 7.0, K)
    numbers = (100 * np.floor(middles[:, 1] / 0.05) + np.floor(middles[:, 0] / 0.05) + 5000).astype(int)
    inside = ((pixels > 1) & (pixels < np.array(SIZE) - 2)).all(1)
    assert inside.sum() > 100
    at = np.rint(pixels[inside]).astype(int)
    assert np.array_equal(seen[at[:, 1], at[:, 0]], numbers[inside])


@pytest.mark.parametrize("distortion", LENSES)
def test_undistorting_gives_the_pinhole(distortion):
    lens = Lens.of(K, *SIZE, distortion)
    images = board(lens)
    bent, straight = lens.bent(images).rgba, lens.straight(images).rgba
    assert bent is not None and straight is not None
    again = undistorted(np.ascontiguousarray(bent[..., 0]), K, distortion).astype(int)
    agrees = np.abs(again - straight[..., 0]) < 80
    assert agrees[40:-40, 40:-40].mean() > 0.97
    assert (np.abs(bent[..., 0].astype(int) - straight[..., 0]) < 80).mean() < 0.95


def test_barrel_distortion_sees_farther_aside():
    rays = LENSES[0].rays(K, *SIZE)
    assert np.abs(rays[240, 0, 0]) > 319.5 / 400 and LENSES[1].rays(K, *SIZE)[240, 0, 0] > -319.5 / 400


def test_coefficients_are_counted():
    with pytest.raises(ValidationError, match="give 4 or 5"):
        Distortion(coefficients=(0.1,))

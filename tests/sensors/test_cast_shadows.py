"""What moves keeps the sun off the ground: where geometry says, by as much as the sun gives, and not twice."""

from __future__ import annotations

import numpy as np
import pytest

from assets.mesh import Mesh
from assets.shapes import box
from sensors.bvh import Bvh
from sensors.cameras import CameraRenderer, Light
from sensors.cameras.cast_shadows import CastShadows
from sensors.scene import Instances

LIGHT = Light(
    sun_elevation_deg=45.0, sun_azimuth_deg=90.0, haze_per_m=0.0
)  # shadows fall southwards, 1 m a metre of height
GROUND = Mesh.of(
    np.array([[-60, -60, 0], [60, -60, 0], [60, 60, 0], [-60, 60, 0]]), np.array([[0, 1, 2], [0, 2, 3]]), "asphalt"
)
CUBE = box((2, 2, 2), (0, 0, 1), "car_trim")
P = np.array([[400.0, 0, 320, 0], [0, 400, 240, 0], [0, 0, 1, 0]])
# 30 m up, looking straight down, image x to the east, y to the south
POSE = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 30.0], [0, 0, 0, 1]])


def instances(*places: tuple[float, float]) -> Instances:
    count = len(places)
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :2, 3] = np.reshape(places, (count, 2))
    return Instances(
        tuple(map(str, range(count))), ("car",) * count, ("cube",) * count, poses, np.ones((count, 3)),
        np.full((count, 3), 2.0), np.zeros((count, 3)), np.zeros(count), np.zeros(count, np.float32),
        np.zeros((count, 3), np.float32),
    )  # fmt: skip


def seen(world: Mesh, things: Instances, light: Light = LIGHT):
    with CameraRenderer(world, lambda _: CUBE, light, width=640, height=480) as renderer:
        plain = renderer.render(POSE, P, things)
    return plain, CastShadows(lambda _: CUBE, light, Bvh(world)).onto(plain, POSE, P, things)


def at(images, x: float, y: float) -> np.ndarray:
    """Linear light of the ground at a place."""
    u, v = 320 + 400 * x / 30, 240 - 400 * y / 30
    return (images.rgb[round(v), round(u)] / 255.0) ** 2


def test_the_shadow_lies_opposite_the_sun_as_long_as_the_body_is_high():
    plain, shaded = seen(GROUND, instances((0, 0)))
    changed = np.argwhere((plain.rgb != shaded.rgb).any(2))
    y = (240 - changed[:, 0]) * 30 / 400
    x = (changed[:, 1] - 320) * 30 / 400
    assert y.min() == pytest.approx(-3, abs=0.1) and y.max() < -0.9  # from the foot at −1 to −1 − 2
    assert x.min() == pytest.approx(-1, abs=0.1) and x.max() == pytest.approx(1, abs=0.1)


def test_ground_in_shadow_keeps_the_skys_light():
    _, shaded = seen(GROUND, instances((0, 0)))
    albedo = at(shaded, 10, 10) / (np.array(LIGHT.sky_rgb) + np.array(LIGHT.sun_rgb) * np.sin(np.pi / 4))
    assert at(shaded, 0, -2) == pytest.approx(albedo * LIGHT.sky_rgb, rel=0.06)


def test_two_shadows_are_no_darker_than_one():
    _, one = seen(GROUND, instances((0, 0)))
    _, two = seen(GROUND, instances((0, 0), (0.3, 0.2)))
    assert np.allclose(at(one, 0, -2), at(two, 0, -2))


def test_ground_that_a_house_shades_already_stays_as_it_is():
    house = box((10, 2, 12), (0, 8, 6), "brick")
    plain, shaded = seen(Mesh.merge([GROUND, house]), instances((0, 0)))
    assert np.array_equal(plain.rgb, shaded.rgb)


def test_at_night_there_are_none():
    plain, shaded = seen(GROUND, instances((0, 0)), Light(sun_elevation_deg=2.0))
    assert shaded is plain


def test_the_same_image_without_anybody():
    plain, shaded = seen(GROUND, instances())
    assert shaded is plain

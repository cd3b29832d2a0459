"""Intensity projected from camera images: equation, occlusion, and lamps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from assets.mesh import Mesh
from assets.shapes import box
from sensors.camera_view import CameraView
from sensors.effects.light.projected_intensity import paper_model, reference_model
from sensors.scene import Scene
from sensors.shot import Shot
from sensors.tracing import Tracer
from sensors.world import Traced
from tests.sensors.effects.scenes import PATTERN, effect, no_model, sensor
from tests.sensors.worlds import block, instances, pose, wall

WIDTH, HEIGHT, FOCAL = 600, 300, 300.0
FORWARD = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)
P = np.array([[FOCAL, 0, WIDTH / 2, 0], [0, FOCAL, HEIGHT / 2, 0], [0, 0, 1, 0]])
WALL = Scene(wall(20.0, half_m=300), no_model)


def view(gray, depth_m=20.0):
    """A camera at the sensor's place that looks along x; columns of `gray` from left to right."""
    image = np.broadcast_to(np.asarray(gray, np.uint8), (HEIGHT, WIDTH)).copy()
    return CameraView(image, np.full((HEIGHT, WIDTH), depth_m, np.float32), P, FORWARD)


def measured(camera, scene=WALL, placed=None, seed=0, **parameters):
    parameters = {"preset": "paper", "gain": 1.0, "peak_threshold": 1.01, "peak_contrast": 0.3} | parameters
    placed = instances([]) if placed is None else placed
    hits = Tracer(PATTERN.rays(), PATTERN.range_m).trace(scene, np.eye(4), placed)
    shot = Shot(PATTERN, hits.rays, traced=Traced(hits), camera=camera)
    model = sensor(effect("projected_intensity", **parameters))
    return model.returns_of(shot, np.random.default_rng(seed)), shot


def head_on(returns, shot):
    """Azimuths of returns that the camera sees nearly head-on."""
    azimuth = shot.rays.azimuth[returns.beam]
    return azimuth, (np.abs(azimuth) < 0.2) & (shot.rays.direction[returns.beam, 0] > 0.97)


@pytest.mark.parametrize("seed", range(4))
def test_black_pixels_give_r2_and_white_ones_r1_more(seed):
    halves = np.where(np.arange(WIDTH) < WIDTH / 2, 0, 255)
    returns, shot = measured(view(halves), seed=seed)
    azimuth, near = head_on(returns, shot)
    black = returns.intensity[near & (azimuth > 0.02)]
    white = returns.intensity[near & (azimuth < -0.02)]
    assert black.min() > 0.19 and black.max() <= 0.3
    assert 0.25 * 0.97 < np.median(white) - np.median(black) <= 0.5


def test_what_stands_behind_something_nearer_takes_its_light_from_its_albedo():
    dark, hidden = measured(view(0)), measured(view(0, depth_m=10.0))
    _, near = head_on(*dark)
    assert (hidden[0].intensity[near] > dark[0].intensity[near] + 0.05).all()
    without, _ = measured(None)
    np.testing.assert_allclose(hidden[0].intensity, without.intensity, rtol=1e-5)


def test_outside_the_image_surfaces_are_as_bright_as_the_camera_shows_their_like():
    """One material everywhere: a darker image darkens what it does not show, too."""
    levels = []
    for gray in (60, 120):
        returns, shot = measured(view(gray), scene=Scene(box((40, 40, 30), (0, 0, 0), "concrete"), no_model))
        behind = shot.rays.direction[returns.beam, 0] < -0.97
        levels.append(np.median(returns.intensity[behind]))
    assert levels[0] < levels[1] - 0.25 * 50 / 255


def test_every_vehicle_has_its_own_brightness_for_equal_paint_and_light():
    placed = instances([pose(15.0, 4.0, -0.7), pose(15.0, -4.0, -0.7)])
    returns, shot = measured(view(128), Scene(Mesh.empty(), lambda name: block((4.0, 1.7, 1.5))), placed)
    front = shot.cos_incidence(returns) > 0.95
    means = [returns.intensity[front & (returns.instance == row)].mean() for row in (0, 1)]
    assert abs(means[0] - means[1]) > 0.01


def test_a_spot_that_outshines_its_surroundings_saturates_and_a_bright_wall_does_not():
    image = np.full((HEIGHT, WIDTH), 60, np.uint8)
    image[HEIGHT // 2 : HEIGHT // 2 + 12, WIDTH // 2 - 6 : WIDTH // 2 + 6] = 250
    returns, _ = measured(view(image), peak_threshold=0.8)
    beams = 12 * 12 / FOCAL**2 / np.radians(360 / 2083) / np.radians(0.345)  # the spot's solid angle over a beam's
    assert np.count_nonzero(returns.intensity == 1) == pytest.approx(beams, rel=0.3)
    bright, _ = measured(view(250), peak_threshold=0.8)
    assert not (bright.intensity == 1).any()


def test_plates_and_signs_saturate_whatever_the_light():
    returns, _ = measured(view(40), Scene(wall(20.0, "sign_face", half_m=300), no_model))
    assert (returns.intensity == 1).all()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), things=st.integers(0, 40))
def test_constants_lie_within_the_published_ranges(seed, things):
    law = paper_model(np.random.default_rng(seed), things)
    assert ((law.r1 >= 0.25) & (law.r1 <= 0.5) & (law.r2 >= 0.2) & (law.r2 <= 0.3)).all()
    assert ((law.exponent >= 0) & (law.exponent <= 8)).all() and law.exponent[-1] < 1
    law = reference_model(np.random.default_rng(seed), things)
    reflectivity = (law.r1 + law.r2)[:-1]
    assert ((reflectivity > 0.079) & (reflectivity < 0.501)).all() and law.r1[-1] == np.float32(0.4)
    assert (law.exponent <= 3).all()


def test_exponents_of_vehicles_are_spread_evenly_over_0_to_8():
    law = paper_model(np.random.default_rng(5), 4000)
    assert stats.kstest(law.exponent[:-1] / 8, "uniform").pvalue > 0.01


def test_a_line_of_falloff_halves_at_half_its_end():
    model = sensor(effect("linear_falloff", end_m=80.0))
    hits = Tracer(PATTERN.rays(), PATTERN.range_m).trace(WALL, np.eye(4), instances([]))
    returns, _ = model.measure_returns(hits)
    at = np.argmin(np.abs(returns.range_m - 40))
    assert returns.intensity[at] == pytest.approx(returns.reflectance[at] / 2, rel=2e-3)
    assert (returns.intensity[returns.range_m >= 80] == 0).all() and (returns.range_m >= 80).any()


def test_what_is_weaker_than_epsilon_is_lost_and_all_else_is_epsilon_weaker():
    model = sensor(effect("intensity_jitter", sigma=0.05), effect("intensity_cutoff", epsilon=0.3))
    noisy = sensor(effect("intensity_jitter", sigma=0.05))
    hits = Tracer(PATTERN.rays(), PATTERN.range_m).trace(WALL, np.eye(4), instances([]))
    (cut, _), (whole, _) = (m.measure_returns(hits, np.random.default_rng(1)) for m in (model, noisy))
    np.testing.assert_array_equal(cut.beam, whole.beam[whole.intensity >= 0.3])
    np.testing.assert_allclose(cut.intensity, whole.intensity[whole.intensity >= 0.3] - 0.3, atol=1e-6)

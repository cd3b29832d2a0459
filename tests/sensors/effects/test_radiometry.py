"""Intensities, detection, noise and rounding: equations and distributions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from sensors.scene import Scene
from tests.sensors.effects.scenes import cars, dense, effect, no_model, of_hits, room, sensor, street
from tests.sensors.worlds import plane, wall

WALL = Scene(wall(20.0, half_m=300), no_model)
RHO = 0.40  # concrete


@pytest.fixture(scope="module")
def plain():
    return of_hits(sensor(), WALL)


def after(*effects, scene=WALL, **more):
    return of_hits(sensor(*effects), scene, **more)[0]


@settings(max_examples=8, deadline=None)
@given(n=st.floats(0, 6))
def test_incidence_falloff_is_a_power_of_the_cosine(plain, n):
    returns, shot = plain
    cos = shot.rays.direction[returns.beam, 0]
    np.testing.assert_allclose(after(effect("incidence_falloff", exponent=n)).intensity, RHO * cos**n, atol=2e-3)


@settings(max_examples=8, deadline=None)
@given(r0=st.floats(1, 100), p=st.floats(0, 4))
def test_range_falloff_follows_its_equation(plain, r0, p):
    expected = RHO * (1 + plain[0].range_m / r0) ** -p
    found = after(effect("range_falloff", reference_m=r0, exponent=p)).intensity
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_extinction_halves_where_it_should_and_loses_the_weakest(plain):
    alpha = np.log(2) / 2 / 25
    returns = plain[0]
    found = after(effect("atmospheric_extinction", alpha_per_m=alpha))
    np.testing.assert_allclose(found.intensity, RHO * 0.5 ** (found.range_m / 25), rtol=1e-4)
    foggy = after(effect("atmospheric_extinction", alpha_per_m=0.05))
    reach = np.log(RHO / 0.005) / 0.1
    assert foggy.range_m.max() <= reach < returns.range_m.max()
    assert len(foggy) == np.count_nonzero(returns.range_m <= reach)


def test_focal_response_is_zero_at_the_focus_and_grows_with_distance_from_it(plain):
    returns = plain[0]
    found = after(effect("focal_response", focal_distance_m=30.0, slope=0.5)).intensity - RHO
    at = np.argmin(np.abs(returns.range_m - 30))
    assert found[at] == pytest.approx(0, abs=2e-3)
    f, d = 30.0 * 100, returns.range_m / 0.002
    law = 0.5 / 255 * np.abs(256 * (1 - f / 13100) ** 2 - 256 * (1 - d / 65535) ** 2)
    np.testing.assert_allclose(found, np.minimum(law, 1 - RHO), atol=1e-4)


def test_halving_the_gain_of_a_ring_halves_its_intensity(plain):
    gains = np.where(np.arange(64) == 5, 0.5, 1.0)
    found, shot = of_hits(sensor(effect("ring_gain", gains=tuple(gains))), WALL)
    ring = shot.rays.ring[found.beam]
    assert found.intensity[ring == 5] == pytest.approx(RHO / 2)
    assert found.intensity[ring != 5] == pytest.approx(RHO)


def test_only_retro_reflectors_shine_and_only_up_to_one():
    found, shot = of_hits(sensor(effect("retroreflection", gain=3.0)), street(), placed=cars())
    bare, _ = of_hits(sensor(), street(), placed=cars())
    retro = shot.is_material("retro", found)
    assert retro.sum() > 10 and (found.intensity[retro] == 1).all()
    np.testing.assert_array_equal(found.intensity[~retro], bare.intensity[~retro])


def test_weak_signals_are_reported_as_zero():
    found = after(effect("intensity_floor", floor=0.3), scene=street())
    assert (found.intensity == 0).any()
    assert len(found) == len(after(scene=street()))
    bare = after(scene=street())
    np.testing.assert_allclose(found.intensity, np.maximum(bare.intensity - 0.3, 0) / 0.7, atol=1e-6)


@pytest.mark.parametrize("softness", [0.0, 0.03])
def test_below_the_least_signal_intensity_is_zero_and_above_it_unchanged(softness):
    bare = after(scene=street(), placed=cars())
    found = after(effect("intensity_floor", floor=0.0, least=0.3, softness=softness), scene=street(), placed=cars())
    zero = found.intensity == 0
    np.testing.assert_allclose(found.intensity[~zero], bare.intensity[~zero], atol=1e-6)
    np.testing.assert_array_equal(found.beam, bare.beam)
    if softness == 0:
        np.testing.assert_array_equal(zero, bare.intensity < 0.3)
        return
    for level in np.unique(bare.intensity):
        rows = bare.intensity == level
        if rows.sum() > 300:
            chance = 1 / (1 + np.exp((level - 0.3) / softness))
            assert stats.binomtest(int(zero[rows].sum()), int(rows.sum()), chance).pvalue > 1e-4


@settings(max_examples=8, deadline=None)
@given(focus=st.floats(30, 80), blur=st.floats(20, 40))
def test_a_focused_receiver_sees_best_at_one_range_and_less_on_either_side(focus, blur):
    road = Scene(plane(), no_model)
    bare = after(scene=road)
    signal = after(effect("receiver_focus", focus_m=focus, blur_m=blur), scene=road).intensity / bare.intensity
    order = np.argsort(bare.range_m)
    range_m, signal = bare.range_m[order], signal[order]
    best = focus * blur**2 / (focus**2 + blur**2)
    assert signal.max() == pytest.approx(1, abs=0.02)
    assert range_m[signal.argmax()] == pytest.approx(best, abs=1.5)
    assert (np.diff(signal[range_m < best]) >= -1e-5).all()
    assert (np.diff(signal[range_m > best]) <= 1e-5).all()


def test_without_blur_light_falls_with_the_square_of_the_distance():
    road = Scene(plane(), no_model)
    bare = after(scene=road)
    found = after(effect("receiver_focus", focus_m=1000.0, blur_m=0.1), scene=road)
    falling = found.intensity / bare.intensity * bare.range_m**2
    np.testing.assert_allclose(falling, falling.mean(), rtol=1e-3)


def test_glossy_paint_answers_head_on_as_before():
    found, shot = of_hits(sensor(effect("paint_gloss", gloss=1.0, exponent=10.0)), street(), placed=cars())
    bare, _ = of_hits(sensor(), street(), placed=cars())
    painted = shot.is_material("paint", found)
    cos = shot.cos_incidence(found)[painted]
    np.testing.assert_allclose(found.intensity[painted], bare.intensity[painted] * cos**10, atol=1e-5)
    np.testing.assert_array_equal(found.intensity[~painted], bare.intensity[~painted])


@pytest.mark.parametrize(("threshold", "softness"), [(0.4, 0.05), (0.35, 0.05), (0.5, 0.1)])
def test_the_threshold_keeps_a_logistic_share(plain, threshold, softness):
    kept = len(after(effect("detection_threshold", threshold=threshold, softness=softness)))
    chance = 1 / (1 + np.exp(-(RHO - threshold) / softness))
    assert stats.binomtest(kept, len(plain[0]), chance).pvalue > 1e-3


@pytest.mark.parametrize(("signal", "steepness"), [(0.4, 3.0), (0.2, 1.0), (0.6, 4.0)])
def test_pulses_are_noticed_by_a_power_of_their_signal_and_not_by_the_gain_they_are_reported_with(
    plain, signal, steepness
):
    pulses = effect("pulse_detection", signal=signal, steepness=steepness)
    kept = after(pulses)
    chance = 1 / (1 + (signal / RHO) ** steepness)
    assert stats.binomtest(len(kept), len(plain[0]), chance).pvalue > 1e-3
    gained = after(pulses, effect("ring_gain", gains=[0.1] * plain[1].pattern.rings))
    np.testing.assert_array_equal(gained.beam, kept.beam)
    np.testing.assert_allclose(gained.intensity, 0.1 * kept.intensity, rtol=1e-5)


def test_retro_reflectors_are_always_noticed():
    sign = Scene(wall(20.0, material="sign_face"), no_model)
    blind = after(effect("pulse_detection", signal=1.0, steepness=50.0), scene=sign)
    assert len(blind) == len(after(scene=sign)) > 0


@pytest.mark.parametrize("length", [20.0, 100.0, 1000.0])
def test_what_the_path_takes_grows_with_its_length(plain, length):
    kept = after(effect("path_dropout", mean_path_m=length))
    range_m = plain[0].range_m
    near = range_m < np.median(range_m)
    for rows in (near, ~near):
        chance = np.exp(-range_m[rows] / length)
        found = int(np.isin(plain[0].beam[rows], kept.beam).sum())
        assert abs(found - chance.sum()) < 4 * np.sqrt((chance * (1 - chance)).sum())


@settings(max_examples=6, deadline=None)
@given(p=st.floats(0.01, 0.99), seed=st.integers(0, 5))
def test_dropout_loses_its_share_independently(plain, p, seed):
    found = after(effect("random_dropout", probability=p), seed=seed)
    lost = ~np.isin(plain[0].beam, found.beam)
    assert stats.binomtest(int(lost.sum()), len(lost), p).pvalue > 1e-5
    together = np.mean(lost[1:] & lost[:-1])
    assert together == pytest.approx(p * p, abs=5 / np.sqrt(len(lost)))


def test_maximum_range_grows_with_the_root_of_reflectance():
    found = after(effect("max_range", range_m=15.0))
    assert found.range_m.max() == pytest.approx(15 * np.sqrt(RHO / 0.1), rel=1e-3)


@settings(max_examples=5, deadline=None)
@given(sigma=st.floats(0.005, 0.3), slope=st.floats(0, 0.01), seed=st.integers(0, 5))
def test_range_noise_is_gaussian_with_its_sigma(plain, sigma, slope, seed):
    found = after(effect("range_noise", sigma_m=sigma, sigma_per_m=slope), seed=seed)
    spread = np.hypot(sigma, slope * plain[0].range_m)
    z = (found.range_m - plain[0].range_m) / spread
    assert stats.kstest(z[::7], "norm").pvalue > 1e-4
    assert z.std() == pytest.approx(1, abs=0.02)


def test_intensity_noise_is_relative(plain):
    found = after(effect("intensity_noise", sigma_rel=0.1))
    z = (found.intensity / RHO - 1) / 0.1
    assert z.mean() == pytest.approx(0, abs=0.02) and z.std() == pytest.approx(1, abs=0.02)


@settings(max_examples=8, deadline=None)
@given(a=st.floats(-0.5, 0.5), k=st.floats(0, 20))
def test_range_walk_depends_on_intensity_alone(a, k):
    bare, _ = of_hits(sensor(), street(), placed=cars())
    found, _ = of_hits(sensor(effect("range_walk", amplitude_m=a, decay=k)), street(), placed=cars())
    np.testing.assert_allclose(found.range_m - bare.range_m, a * np.exp(-k * bare.intensity), atol=1e-4)


def test_range_walk_acts_after_radiometry_and_before_noise(plain):
    walk, falloff = effect("range_walk", amplitude_m=0.3, decay=4.0), effect("incidence_falloff", exponent=2.0)
    found = after(effect("intensity_noise", sigma_rel=0.5), walk, falloff)
    clean = after(falloff)
    expected = plain[0].range_m + 0.3 * np.exp(-4 * clean.intensity)
    np.testing.assert_allclose(found.range_m, expected, atol=1e-4)


def test_incidence_bias_is_the_tangent_up_to_ten(plain):
    returns, shot = plain
    cos = shot.rays.direction[returns.beam, 0].astype(float)
    found = after(effect("incidence_bias", gain_m=0.05)).range_m - returns.range_m
    expected = 0.05 * np.minimum(np.sqrt(1 - cos**2) / cos, 10)
    steep = cos > 0.12
    np.testing.assert_allclose(found[steep], expected[steep], atol=2e-3)
    ground = after(effect("incidence_bias", gain_m=0.05), scene=Scene(plane(), no_model))
    bare = after(scene=Scene(plane(), no_model))
    assert (ground.range_m - bare.range_m).max() == pytest.approx(0.5, abs=1e-3)


def test_biases_add_and_scale(plain):
    r = plain[0].range_m.astype(float)
    np.testing.assert_allclose(after(effect("range_bias", offset_m=-0.1)).range_m, r - 0.1, atol=1e-4)
    np.testing.assert_allclose(after(effect("range_scale", scale_ppm=2000.0)).range_m, r * 1.002, atol=1e-4)
    offsets = np.linspace(-0.1, 0.1, 64)
    found, shot = of_hits(sensor(effect("ring_range_offset", offsets_m=tuple(offsets))), WALL)
    np.testing.assert_allclose(found.range_m, r + offsets[shot.rays.ring[found.beam]], atol=1e-4)


@settings(max_examples=10, deadline=None)
@given(step=st.floats(0.001, 0.5))
def test_rounding_keeps_to_its_steps(plain, step):
    found = after(effect("range_quantization", step_m=step), effect("range_noise", sigma_m=0.02, sigma_per_m=0.0))
    steps = found.range_m.astype(float) / step
    assert np.abs(steps - np.rint(steps)).max() * step < 2e-5
    level = after(effect("intensity_quantization", step=step), effect("incidence_falloff", exponent=1.0))
    shades = level.intensity.astype(float) / step
    assert (np.abs(shades - np.rint(shades)) * step < 1e-6).sum() + (level.intensity == 1).sum() >= len(level)


def test_kitti_steps_are_hundredths():
    found = after(effect("intensity_quantization", step=0.01), effect("incidence_falloff", exponent=1.0))
    np.testing.assert_allclose(found.intensity * 100, np.rint(found.intensity * 100), atol=1e-4)


def test_the_same_seed_gives_the_same_points_and_another_effect_leaves_the_draws_alone():
    noise, drop = effect("range_noise"), effect("random_dropout")
    one, two = after(noise, scene=room(), seed=4), after(noise, scene=room(), seed=4)
    np.testing.assert_array_equal(one.range_m, two.range_m)
    assert (after(noise, scene=room(), seed=5).range_m != one.range_m).any()
    both = after(drop, noise, scene=room(), seed=4)
    beams = 64 * 2083
    noisy = dense(one, beams)
    np.testing.assert_array_equal(noisy[both.beam], both.range_m.astype(float))

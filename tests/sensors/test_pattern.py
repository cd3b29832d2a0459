import numpy as np
import pytest

from sensors.errors import SensorError
from sensors.pattern import load_pattern, parse_pattern, pattern_names
from sensors.point_cloud import PointCloud


def test_hdl64e_has_two_blocks_of_evenly_spaced_lasers():
    pattern = load_pattern("hdl64e")
    elevation = np.array(pattern.elevation_deg)
    assert len(elevation) == 64
    assert elevation[[0, 31, 32, 63]] == pytest.approx([2.03, -8.657, -8.8, -24.824])
    for block in (elevation[:32], elevation[32:]):
        assert np.ptp(np.diff(block)) < 2e-4
    assert pattern.block == (0,) * 32 + (1,) * 32


def test_rays_are_ring_major_and_the_head_turns_clockwise():
    pattern = load_pattern("hdl64e")
    rays = pattern.rays()
    ring = rays.ring.reshape(64, 2083)
    azimuth = rays.azimuth.reshape(64, 2083)
    assert (ring == np.arange(64)[:, None]).all()
    assert (np.diff(azimuth, axis=1) < 0).all()
    assert azimuth[0, 0] == pytest.approx(np.pi - np.pi / 2083, abs=1e-6)


def test_a_beam_fires_when_the_head_faces_it():
    rays = load_pattern("hdl64e").rays()
    np.testing.assert_allclose(rays.time_s, -rays.azimuth / (2 * np.pi) * 0.1, atol=1e-8)
    assert -0.05 < rays.time_s.min() < -0.0499 and 0.0499 < rays.time_s.max() < 0.05


def test_directions_are_unit_vectors_at_the_lasers_elevation():
    pattern = load_pattern("hdl64e_single")
    rays = pattern.rays()
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=1), 1, atol=1e-6)
    elevation = np.degrees(np.arcsin(rays.direction[:, 2]))
    np.testing.assert_allclose(elevation, np.array(pattern.elevation_deg)[rays.ring], atol=1e-4)


def test_a_sideways_fan_turns_the_beam_but_not_its_firing_time():
    text = load_pattern("hdl64e").model_copy(update={"azimuth_offset_deg": (5.0,) + (0.0,) * 63}).to_yaml()
    rays = parse_pattern(text, origin="fanned").rays()
    azimuth, time_s = rays.azimuth.reshape(64, -1), rays.time_s.reshape(64, -1)
    turned = np.angle(np.exp(1j * (azimuth[0] - azimuth[1])))
    np.testing.assert_allclose(np.degrees(turned), 5, atol=1e-3)
    np.testing.assert_array_equal(time_s[0], time_s[1])
    assert azimuth.max() <= np.pi and azimuth.min() > -np.pi - 1e-6


@pytest.mark.parametrize("name", pattern_names())
def test_patterns_survive_their_file_format(name):
    pattern = load_pattern(name)
    assert parse_pattern(pattern.to_yaml(), origin=name) == pattern


GOOD = "name: p\nsweep_s: 0.1\nfirings: 10\nrange_m: [1, 100]\nelevation_deg: [1.0, -1.0]\n"


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (GOOD + "block: [0]\n", "block has 1 entries"),
        (GOOD + "colour: red\n", "unknown key 'colour'"),
        (GOOD.replace("[1, 100]", "[100, 1]"), "range_m"),
        (GOOD.replace("firings: 10", "firings: 0"), "firings"),
        ("- 1\n", "pattern x"),
        ("{", "not YAML"),
    ],
)
def test_a_bad_pattern_is_named_with_its_fault(text, complaint):
    with pytest.raises(SensorError, match=complaint.replace("[", r"\[")) as caught:
        parse_pattern(text, origin="x")
    assert "\n" not in str(caught.value)


def test_an_unknown_pattern_lists_the_available_ones():
    with pytest.raises(SensorError, match="hdl64e"):
        load_pattern("hdl65")


def test_lasers_fire_with_their_column_unless_the_pattern_says_how_much_later():
    plain = load_pattern("vlp16")
    later = tuple(2.304 * laser for laser in range(16))
    staggered = parse_pattern(plain.model_copy(update={"firing_offset_us": later}).to_yaml(), origin="test")
    difference = staggered.rays().time_s.astype(float) - plain.rays().time_s
    expected = 1e-6 * np.repeat(later, plain.firings)
    np.testing.assert_allclose(difference, expected, atol=1e-8)
    np.testing.assert_array_equal(staggered.rays().direction, plain.rays().direction)
    assert "firing_offset_us" not in plain.to_yaml()


def test_firing_offsets_are_one_a_laser():
    with pytest.raises(SensorError, match="firing_offset_us has 3 entries"):
        parse_pattern(
            load_pattern("vlp16").model_copy(update={"firing_offset_us": (0.0, 1.0, 2.0)}).to_yaml(), origin="x"
        )


def test_an_encoder_reports_whole_ticks() -> None:
    """Steps of KITTI's unit: 0.18° in 85 % of firings and 0.09° in the rest."""
    pattern = load_pattern("hdl64e_kitti")
    column = np.degrees(pattern.rays().azimuth[: pattern.firings].astype(float)) - pattern.azimuth_offset_deg[0]
    steps = np.abs((np.diff(column) + 180) % 360 - 180)
    assert np.allclose(steps / 0.09, np.rint(steps / 0.09), atol=1e-3)
    assert np.mean(np.isclose(steps, 0.18, atol=1e-3)) == pytest.approx(0.854, abs=0.005)
    assert np.mean(np.isclose(steps, 0.09, atol=1e-3)) == pytest.approx(0.146, abs=0.005)


def test_points_of_a_file_run_counter_clockwise_from_the_front_within_a_laser() -> None:
    """Recovery of rings from the wrap of the azimuth finds every laser."""
    rays = load_pattern("hdl64e_kitti").rays()
    count = len(rays)
    cloud = PointCloud(
        rays.direction * np.float32(12.34),
        *(np.zeros(count, np.float32), rays.ring, rays.azimuth, rays.time_s),
        *(np.zeros(count, np.uint8), np.zeros(count, np.int16), np.zeros(count, np.uint8)),
    ).in_file_order()
    azimuth = np.arctan2(cloud.xyz[:, 1], cloud.xyz[:, 0]) % (2 * np.pi)
    wraps = np.flatnonzero(np.diff(azimuth) < -np.pi)
    assert len(wraps) == 63
    assert np.array_equal(np.cumsum(np.isin(np.arange(count), wraps + 1)), cloud.ring)
    assert np.all(np.diff(azimuth)[np.diff(cloud.ring.astype(int)) == 0] > -1e-6)

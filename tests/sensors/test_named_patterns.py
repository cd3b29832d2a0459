"""Named patterns against their data sheets."""

import numpy as np
import pytest

from sensors.pattern import load_pattern


@pytest.mark.parametrize(
    ("name", "rings", "top_deg", "bottom_deg", "beams_per_s"),
    [
        ("vlp16", 16, 15.0, -15.0, 300_000),
        ("hdl32e", 32, 10.67, -30.67, 700_000),
        ("os1_64", 64, 16.6, -16.6, 655_360),
        ("pandar64", 64, 15.0, -25.0, 1_152_000),
        ("hdl64e_kitti", 64, 1.94, -25.0, 1_333_333),
    ],
)
def test_a_pattern_is_what_its_data_sheet_says(name, rings, top_deg, bottom_deg, beams_per_s):
    pattern = load_pattern(name)
    elevation = np.array(pattern.elevation_deg)
    assert pattern.rings == rings
    assert elevation[[0, -1]] == pytest.approx([top_deg, bottom_deg], abs=0.02)
    assert (np.diff(elevation) < 0).all()
    assert rings * pattern.firings / pattern.sweep_s == pytest.approx(beams_per_s, rel=0.04)


def test_kitti_s_lasers_are_fanned_out_sideways_and_end_at_80_m():
    pattern = load_pattern("hdl64e_kitti")
    fan = np.array(pattern.azimuth_offset_deg)
    assert -11 < fan.min() < -7 and 7 < fan.max() < 11
    assert pattern.range_m[1] == 80.0
    assert pattern.block == (0,) * 32 + (1,) * 32

"""Scanners that do not spin: tables of directions, prisms and mirrors."""

import json
from pathlib import Path

import numpy as np
import pytest

from sensors.errors import SensorError
from sensors.pattern import load_pattern, parse_pattern

SAMPLES = Path(__file__).resolve().parents[3] / "shared" / "samples"
HEAD = "name: own\nsweep_s: 0.1\nrange_m: [0.5, 100]\n"


def own(folder, table: str, name="own.yaml"):
    (folder / "beams.csv").write_text(table)
    (folder / name).write_text(f"{HEAD}directions: beams.csv\n")
    return folder / name


def test_beams_of_a_table_leave_as_it_says(tmp_path):
    table = "time_s,x,y,z,channel\n0,1,0,0,0\n0.02,0.6,0.8,0,1\n0.08,0,0.6,0.8,0\n"
    rays = load_pattern(own(tmp_path, table)).rays()
    assert rays.ring.tolist() == [0, 0, 1]
    assert np.allclose(rays.direction, [[1, 0, 0], [0, 0.6, 0.8], [0.6, 0.8, 0]], atol=1e-6)
    assert np.allclose(rays.time_s, [-0.05, 0.03, -0.03])
    assert np.allclose(rays.azimuth, [0, np.pi / 2, np.arctan2(0.8, 0.6)])


def test_angles_and_vectors_are_the_same_beams(tmp_path):
    by_angle = load_pattern(own(tmp_path, "time_s,azimuth_deg,elevation_deg\n0,30,10\n0.01,-170,-20\n")).rays()
    flat = [np.cos(np.radians(e)) for e in (10, -20)]
    vectors = [
        (flat[0] * np.cos(np.radians(30)), flat[0] * np.sin(np.radians(30)), np.sin(np.radians(10))),
        (flat[1] * np.cos(np.radians(-170)), flat[1] * np.sin(np.radians(-170)), np.sin(np.radians(-20))),
    ]
    assert np.allclose(by_angle.direction, vectors, atol=1e-6)


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ("time_s,x,y,z\n0.01,1,0,0\n0,1,0,0\n", "row 3: time 0 s is out of order"),
        ("time_s,x,y,z\n-0.01,1,0,0\n", "out of order"),
        ("time_s,x,y,z\n0,1,0,0\n0.01,1,1,0\n", "row 3: the direction is 1.41421 long"),
        ("time_s,x,y\n0,1,0\n", "give time_s,x,y,z or"),
        ("time_s,x,y,z\n0,nan,0,0\n", "NaN"),
        ("time_s,x,y,z\n0,one,0,0\n", "not a table of numbers"),
        ("time_s,x,y,z\n0.2,1,0,0\n", "after sweep_s"),
        ("time_s,x,y,z,channel\n0,1,0,0,1\n", "channel 0 has no beam"),
        ("time_s,x,y,z,channel\n0,1,0,0,300\n", "give whole numbers, 0 to 255"),
        ("", "holds no row"),
    ],
)
def test_tables_that_are_none_are_refused_in_one_line(tmp_path, table, says):
    with pytest.raises(SensorError) as caught:
        load_pattern(own(tmp_path, table))
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    (tmp_path / "p.yaml").write_text(f"{HEAD}directions: nowhere.csv\n")
    with pytest.raises(SensorError, match=r"nowhere\.csv cannot be read"):
        load_pattern(tmp_path / "p.yaml")


@pytest.mark.parametrize("name", ["rosette_like_mid40", "at128_like"])
def test_a_pattern_is_defined_in_one_file(name):
    pattern = load_pattern(name)
    again = parse_pattern(pattern.to_yaml(), origin="pattern.yaml")
    assert again == pattern
    assert np.array_equal(again.rays().direction, pattern.rays().direction)


def test_a_rosette_fills_its_circle_and_crosses_its_middle():
    pattern = load_pattern("rosette_like_mid40")
    x = pattern.rays().direction[:, 0]
    off = np.degrees(np.arccos(np.clip(x, -1, 1)))
    assert off.max() == pytest.approx(19.2, abs=0.1)
    assert off.min() < 0.5
    assert len(x) / pattern.sweep_s == pytest.approx(100_000)


def test_a_mirror_carries_its_lasers_from_left_to_right():
    rays = load_pattern("at128_like").rays()
    first = rays.ring == 0
    assert np.degrees(rays.azimuth[first][[0, -1]]) == pytest.approx([59.95, -59.95], abs=0.01)
    assert (np.diff(rays.time_s[first]) > 0).all()


@pytest.mark.parametrize(
    ("name", "file", "abs_deg"),
    [("os0_128", "OS-0-128-U1_v2.3.0_1024x10", 1.0), ("os1_128", "OS-1-128_767798045_1024x10_20230712_120049", 1.0)],
)
def test_ousters_are_near_the_angles_of_a_real_unit(name, file, abs_deg):
    path = SAMPLES / "ouster" / f"{file}.json"
    if not path.is_file():
        pytest.skip(f"no real Ouster metadata at {path}")
    unit, pattern = json.loads(path.read_text()), load_pattern(name)
    angles = unit.get("beam_intrinsics", unit)
    up, aside = (np.array(angles[f"beam_{kind}_angles"]) for kind in ("altitude", "azimuth"))
    assert np.abs(np.array(pattern.elevation_deg) - up).max() < 1.5 * abs_deg
    off = np.abs(np.array(pattern.azimuth_offset_deg) + aside)  # theirs count clockwise
    assert np.median(off) < abs_deg / 2


@pytest.mark.parametrize(
    ("name", "file"), [("vlp32c", "velodyne_vlp32"), ("vlp16", "velodyne_vlp16"), ("at128_like", "hesai_at128")]
)
def test_points_of_a_real_scan_lie_on_the_lasers_of_its_make(name, file):
    path = SAMPLES / "nebula" / f"{file}.pcd"
    if not path.is_file():
        pytest.skip(f"no real scan at {path}")
    pypcd4 = pytest.importorskip("pypcd4")
    points = pypcd4.PointCloud.from_path(path).numpy(("x", "y", "z")).astype(np.float64)
    range_m = np.linalg.norm(points, axis=1)
    points, range_m = points[range_m > 5], range_m[range_m > 5]
    up = np.degrees(np.arcsin(points[:, 2] / range_m))
    lasers = np.array(load_pattern(name).elevation_deg)
    off = np.abs(up[:, None] - lasers).min(1)
    assert np.median(off) < 0.05
    assert up.max() < lasers.max() + 0.2
    assert up.min() > lasers.min() - 0.2

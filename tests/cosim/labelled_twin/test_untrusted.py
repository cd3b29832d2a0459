"""A twin of which nothing can be trusted is no twin: the command says which of order, pattern and mount is at fault."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from cosim.cli import main
from cosim.drives.kitti import write_calibration, write_points
from tests.cosim.labelled_twin.scans import ELEVATION_RAD, FIRINGS, flat, scan
from tests.training.tiny_drive import CALIBRATION


def sparse() -> tuple[np.ndarray, np.ndarray]:
    """A scan of ground 0.5 m below by every eighth laser, and their elevations [°]: rings too far apart to bridge."""

    def low(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.full_like(x, -0.5) + 0 * y

    points, ring = scan(low)
    return points[ring % 8 == 0], np.degrees(ELEVATION_RAD)[::8]


def write_drive(folder: Path, points: np.ndarray) -> Path:
    for part in ("velodyne", "calib", "label_2"):
        (folder / part).mkdir(parents=True)
    write_points(folder / "velodyne" / "000000.bin", points)
    write_calibration(folder / "calib" / "000000.txt", CALIBRATION)
    (folder / "label_2" / "000000.txt").write_text("")
    return folder


def write_pattern(path: Path, elevation_deg: np.ndarray) -> Path:
    values = {
        "name": path.stem,
        "sweep_s": 0.1,
        "firings": FIRINGS,
        "range_m": [0.9, 120.0],
        "elevation_deg": [float(one) for one in elevation_deg],
    }
    path.write_text(yaml.safe_dump(values))
    return path


@pytest.fixture
def pattern(tmp_path: Path) -> Path:
    return write_pattern(tmp_path / "own.yaml", np.degrees(ELEVATION_RAD))


def refusal(drive: Path, pattern: Path, capsys: pytest.CaptureFixture[str]) -> str:
    out = drive.with_name("out")
    assert main(["twin", str(drive), "--out", str(out), "--pattern", str(pattern)]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert not (out / "drive.yaml").exists()
    (report,) = [line for line in lines if line.startswith("cosim twin:")]
    return report


def test_a_scan_of_flat_ground_makes_a_twin_and_names_no_other_pattern(tmp_path, pattern, capsys):
    drive = write_drive(tmp_path / "drive", scan(flat)[0])
    assert main(["twin", str(drive), "--out", str(tmp_path / "out"), "--pattern", str(pattern)]) == 0
    assert "pattern is not given" not in capsys.readouterr().err
    assert main(["twin", str(drive), "--out", str(tmp_path / "other")]) == 0
    assert "the beam pattern is not given: hdl64e_kitti" in capsys.readouterr().err


def test_points_in_another_order_are_reported(tmp_path, pattern, capsys):
    points, ring = scan(flat)
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    drive = write_drive(tmp_path / "drive", points[np.lexsort((ring, -np.round(azimuth, 3)))])
    report = refusal(drive, pattern, capsys)
    assert "nothing could be compared with it" in report and "order of points: a ring spans" in report


def test_a_pattern_that_is_not_the_scans_is_reported(tmp_path, capsys):
    points, elevation_deg = sparse()
    drive = write_drive(tmp_path / "drive", points)
    other = write_pattern(tmp_path / "other.yaml", elevation_deg + 8)
    assert "pattern other: its elevations differ by" in refusal(drive, other, capsys)


def test_a_mount_too_low_for_its_rings_is_reported(tmp_path, capsys):
    points, elevation_deg = sparse()
    drive = write_drive(tmp_path / "drive", points)
    report = refusal(drive, write_pattern(tmp_path / "own.yaml", elevation_deg), capsys)
    assert "height of mount: 0.5 m above ground, rings of own are" in report and "the limit is" in report


def test_points_with_z_down_are_reported(tmp_path, pattern, capsys):
    points = scan(flat)[0]
    drive = write_drive(tmp_path / "drive", points * np.array([-1, 1, -1, 1], np.float32))
    upside_down = write_pattern(pattern.with_name("down.yaml"), -np.degrees(ELEVATION_RAD))
    assert "the z axis points down to the ground" in refusal(drive, upside_down, capsys)

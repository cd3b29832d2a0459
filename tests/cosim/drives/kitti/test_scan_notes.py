"""What a drive says of itself: nothing that is not known is passed over in silence, and nothing broken gets through."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cosim.drives.kitti import Drive
from cosim.errors import CosimError, DriveError, FormatError

_QUICK = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def _points(root: Path, name: str) -> np.ndarray:
    return np.fromfile(root / f"velodyne/{name}.bin", "<f4").reshape(-1, 4)


def test_a_complete_drive_has_no_notes(drive_root: Path) -> None:
    assert Drive(drive_root).notes() == ()


def test_broken_points_dark_scans_and_empty_ones_are_counted(drive_root: Path) -> None:
    for name in ("000000", "000001", "000002"):
        (drive_root / f"rays/{name}.npz").unlink()
    points = _points(drive_root, "000000")
    points[:3, 1] = np.nan, np.inf, -np.inf
    points.tofile(drive_root / "velodyne/000000.bin")
    (drive_root / "velodyne/000001.bin").write_bytes(b"")
    dark = _points(drive_root, "000002")
    dark[:, 3] = 0
    dark.tofile(drive_root / "velodyne/000002.bin")
    message = Drive(drive_root).notes()
    assert "3 points hold NaN or infinity: left out" in message
    assert "1 of 3 scans hold no point" in message
    assert any("intensities are absent or all zero in 1 of 3 scans" in note for note in message)
    assert any(note.startswith("rays/ is absent") for note in message)
    assert not Drive(drive_root)["000002"].has_intensity
    assert Drive(drive_root)["000000"].has_intensity
    assert any("1 of 1 scans" in note for note in Drive(drive_root).notes(["000002"]))


def test_intensities_of_another_scale_are_reported(drive_root: Path) -> None:
    points = _points(drive_root, "000000")
    points[:, 3] *= 255
    points.tofile(drive_root / "velodyne/000000.bin")
    assert any("0 to 1 is expected" in note for note in Drive(drive_root).notes())


def test_a_drive_without_a_point_is_one_error(drive_root: Path) -> None:
    for file in (drive_root / "velodyne").glob("*.bin"):
        file.write_bytes(np.full((4, 4), np.nan, "<f4").tobytes())
    with pytest.raises(DriveError, match="none of the 3 scans holds a finite point"):
        Drive(drive_root).notes()


def test_points_without_intensity_are_read_when_the_drive_says_so(drive_root: Path) -> None:
    points = _points(drive_root, "000000")
    points[:, :3].tofile(drive_root / "velodyne/000000.bin")
    with pytest.raises(FormatError, match=r"state `columns: 3` in drive\.yaml"):
        _ = Drive(drive_root)["000000"].points
    (drive_root / "drive.yaml").write_text("kind: measured\nsweep_s: 0.1\ncolumns: 3\n")
    frame = Drive(drive_root)["000000"]
    assert np.array_equal(frame.points[:, :3], points[:, :3])
    assert not frame.points[:, 3].any()
    assert not frame.has_intensity
    assert any("intensities are absent" in note for note in Drive(drive_root).notes(["000000"]))
    (drive_root / "drive.yaml").write_text("kind: measured\ncolumns: 2\n")
    with pytest.raises(DriveError, match="columns is 2"):
        Drive(drive_root)


def test_a_scan_in_another_order_has_no_rings_and_is_reported(drive_root: Path) -> None:
    rng = np.random.default_rng(0)
    (drive_root / "rays/000000.npz").unlink()
    azimuth, level = rng.uniform(-3, 3, 4000), np.zeros(4000)
    shuffled = np.stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), level, rng.random(4000)], -1)
    shuffled.astype("<f4").tofile(drive_root / "velodyne/000000.bin")
    assert any("rings of 1 of 3 scans cannot be recovered" in note for note in Drive(drive_root).notes())


@_QUICK
@given(st.binary(max_size=400))
def test_any_bytes_are_a_scan_or_one_line_of_error(drive_root: Path, content: bytes) -> None:
    (drive_root / "velodyne/000001.bin").write_bytes(content)
    (drive_root / "rays/000001.npz").unlink(missing_ok=True)
    frame = Drive(drive_root)["000001"]
    try:
        points = frame.points
        assert np.isfinite(points).all()
        assert len(points) + frame.bad_points == len(content) // 16
        assert len(frame.rays) == len(points)
        assert np.isfinite(frame.rays.azimuth).all()
    except CosimError as error:
        assert "\n" not in str(error)


@_QUICK
@given(st.text(max_size=120), st.sampled_from(["drive.yaml", "pattern.yaml", "manifest.jsonl"]))
def test_any_text_describes_a_drive_or_is_one_line_of_error(drive_root: Path, text: str, file: str) -> None:
    (drive_root / file).write_text(text, encoding="utf-8", errors="replace")
    try:
        Drive(drive_root).notes()
    except CosimError as error:
        assert "\n" not in str(error)


@_QUICK
@given(
    st.fixed_dictionaries(
        {}, optional={key: st.one_of(st.none(), st.booleans(), st.floats(), st.integers(), st.text(max_size=5))
                      for key in ("kind", "sweep_s", "columns", "pattern")},
    )
)  # fmt: skip
def test_any_values_describe_a_drive_or_are_one_line_of_error(drive_root: Path, values: dict[str, object]) -> None:
    import yaml

    (drive_root / "drive.yaml").write_text(yaml.safe_dump(values), encoding="utf-8")
    (drive_root / "pattern.yaml").unlink(missing_ok=True)
    try:
        Drive(drive_root).notes()
    except CosimError as error:
        assert "\n" not in str(error)


@_QUICK
@given(st.binary(max_size=300), st.sampled_from(["label_2", "calib", "oxts", "twin/frames", "rays"]))
def test_any_bytes_are_a_part_or_one_line_of_error(drive_root: Path, content: bytes, part: str) -> None:
    suffix = {"twin/frames": ".json", "rays": ".npz"}.get(part, ".txt")
    (drive_root / part / f"000001{suffix}").write_bytes(content)
    frame = Drive(drive_root)["000001"]
    readers = {"label_2": "labels", "calib": "calibration", "oxts": "oxts", "twin/frames": "twin", "rays": "rays"}
    try:
        getattr(frame, readers[part])
    except CosimError as error:
        assert "\n" not in str(error)

"""Drives: one reader for simulated and measured folders, whole, partial and broken."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

import numpy as np
import pytest

from cosim.drives.kitti import Drive, write_points
from cosim.errors import CosimError, DriveError, FormatError


def test_a_complete_drive_misses_nothing_and_gives_every_part(drive_root: Path) -> None:
    drive = Drive(drive_root)
    assert drive.frames == ("000000", "000001", "000002")
    assert (drive.kind, drive.sweep_s, drive.missing) == ("simulated", 0.1, ())
    assert drive.pattern == str(drive_root / "pattern.yaml")
    frame = drive["000001"]
    assert frame.points.shape == (50, 4)
    assert frame.rays.ring.tolist() == [7] * 50
    assert not frame.rays.recovered
    assert frame.labels.type == ("Car",)
    assert frame.calibration.cameras == (2,)
    assert frame.image("image_0").shape == (100, 160)
    assert frame.image().shape == (100, 160, 3)
    assert frame.depth[0, 0] == 2
    assert frame.oxts.vf == 1
    assert frame.twin.time_s == 0.1
    assert frame.hits_path.name == "000001.npz"
    assert [path.name for path in frame.static_paths] == ["static.glb"]
    assert drive.model_path(drive.model_names[0]).name == "hatchback_03.glb"


def test_a_measured_drive_needs_scans_and_calibration_only(drive_root: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    for part in ("velodyne", "calib"):
        shutil.copytree(drive_root / part, bare / part)
    drive = Drive(bare)
    assert drive.kind == "measured"
    assert drive["000000"].rays.recovered
    assert np.allclose(drive["000000"].rays.azimuth, np.linspace(3, -3, 50))
    message = "\n".join(drive.missing)
    for part in ("rays/", "image_0/", "label_2/", "oxts/", "twin/frames/", "static", "pattern", "sweep_s"):
        assert part in message
    with pytest.raises(DriveError, match=r"no label_2/000000\.txt; add it, or leave out what needs label_2/"):
        _ = drive["000000"].labels
    with pytest.raises(DriveError, match=r"no static world at twin/static\.glb or twin/static"):
        _ = drive["000000"].static_paths


def test_the_drives_own_words_count(drive_root: Path) -> None:
    (drive_root / "pattern.yaml").unlink()
    (drive_root / "drive.yaml").write_text("kind: measured\npattern: vlp32\nsweep_s: 0.05\n")
    drive = Drive(drive_root)
    assert (drive.kind, drive.pattern, drive.sweep_s) == ("measured", "vlp32", 0.05)


def test_frames_are_those_the_manifest_lists_as_finished(drive_root: Path) -> None:
    (drive_root / "manifest.jsonl").write_text('{"name": "000002"}\n{"name": "000009"}\n{"name": "0000')
    (drive_root / "drive.yaml").unlink()
    drive = Drive(drive_root)
    assert drive.frames == ("000002",)
    assert drive.kind == "simulated"
    assert any("unfinished" in line for line in drive.missing)
    assert any("1 frames that manifest.jsonl lists" in line for line in drive.missing)


def test_lists_of_frames_keep_their_order_and_skip_what_is_not_here(
    drive_root: Path, caplog: pytest.LogCaptureFixture
) -> None:
    drive = Drive(drive_root)
    assert drive.splits == ("train",)
    assert drive.split("train") == ("000002", "000000")
    (drive_root / "ImageSets/val.txt").write_text("999999\n000001\n")
    with caplog.at_level(logging.WARNING):
        assert drive.split("val") == ("000001",)
    assert "1 of 2 frames are not here" in caplog.text
    with pytest.raises(DriveError, match=r"no ImageSets/test\.txt; lists there: train, val"):
        drive.split("test")


@pytest.mark.parametrize("name", ["../../etc/passwd", "/etc/passwd", "a/b", "..", ".hidden", "a\x00b", "-rf", " "])
def test_no_name_leads_out_of_the_drive(drive_root: Path, name: str) -> None:
    drive = Drive(drive_root)
    with pytest.raises(DriveError):
        _ = drive[name]
    with pytest.raises(DriveError):
        drive.model_path(name)
    with pytest.raises(DriveError):
        drive.split(name)
    if name.strip():
        (drive_root / "ImageSets/bad.txt").write_text(f"000000\n{name}\n")
        with pytest.raises(DriveError, match=r"bad\.txt:2: .*cannot be the name of a frame"):
            drive.split("bad")


def test_a_manifest_may_not_lead_out_either(drive_root: Path) -> None:
    (drive_root / "manifest.jsonl").write_text('{"name": "../x"}\n')
    with pytest.raises(DriveError, match=r"manifest\.jsonl:1: '\.\./x' cannot be the name of a frame"):
        Drive(drive_root)


def test_a_frames_world_is_the_one_it_names(drive_root: Path) -> None:
    file = drive_root / "twin/frames/000000.json"
    file.write_text(file.read_text().replace('"time_s"', '"static":"worlds/grid.glb","time_s"', 1))
    with pytest.raises(DriveError, match=r"no static world at twin/worlds/grid\.glb"):
        _ = Drive(drive_root)["000000"].static_paths
    (drive_root / "twin/worlds").mkdir()
    shutil.copy(drive_root / "twin/static.glb", drive_root / "twin/worlds/grid.glb")
    assert [path.name for path in Drive(drive_root)["000000"].static_paths] == ["grid.glb"]
    file.write_text(file.read_text().replace("worlds/grid.glb", "../../x.glb"))
    with pytest.raises(FormatError, match="expected a relative path inside twin/"):
        _ = Drive(drive_root)["000000"].static_paths


def test_a_tiled_world_is_all_its_tiles(drive_root: Path) -> None:
    (drive_root / "twin/static").mkdir()
    (drive_root / "twin/static.glb").rename(drive_root / "twin/static/b.glb")
    shutil.copy(drive_root / "twin/static/b.glb", drive_root / "twin/static/a.glb")
    assert [path.name for path in Drive(drive_root)["000000"].static_paths] == ["a.glb", "b.glb"]


def test_broken_points_are_left_out_with_their_rays_and_counted(
    drive_root: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = drive_root / "velodyne/000000.bin"
    points = np.fromfile(file, np.float32).reshape(-1, 4)
    points[10, 0] = np.nan
    file.write_bytes(points.tobytes())
    frame = Drive(drive_root)["000000"]
    with caplog.at_level(logging.WARNING):
        assert len(frame.points) == len(frame.rays) == 49
    assert frame.bad_points == 1
    assert "left out 1 of 50 points" in caplog.text


def test_rays_of_another_length_are_refused(drive_root: Path) -> None:
    write_points(drive_root / "velodyne/000000.bin", np.ones((49, 4)))
    with pytest.raises(FormatError, match=r"000000\.npz: ring has 50 entries but the scan 49 points"):
        _ = Drive(drive_root)["000000"].rays


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("drive.yaml", "kind: imagined", "kind is 'imagined'; write simulated or measured"),
        ("drive.yaml", "kind: [", "not readable as YAML"),
        ("drive.yaml", "- a", "holds list, not keys"),
        ("drive.yaml", "sweep_s: -1", "sweep_s is -1"),
        ("drive.yaml", "!!python/object/apply:os.getcwd []", "not readable as YAML"),
        ("manifest.jsonl", "{}\n", "manifest.jsonl:1: not an object with a name"),
        ("manifest.jsonl", "[1]\n", "manifest.jsonl:1: not an object with a name"),
        ("manifest.jsonl", "", "lists no finished scan"),
    ],
)
def test_broken_descriptions_are_named(drive_root: Path, file: str, content: str, message: str) -> None:
    (drive_root / file).write_text(content)
    with pytest.raises((DriveError, FormatError), match=message):
        Drive(drive_root)


def test_what_is_no_drive_is_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(DriveError, match="no such folder"):
        Drive(tmp_path / "none")
    with pytest.raises(DriveError, match="no velodyne/ here or in training/"):
        Drive(tmp_path)
    (tmp_path / "velodyne").mkdir()
    with pytest.raises(DriveError, match=r"no calib/; every scan needs"):
        Drive(tmp_path)
    (tmp_path / "calib").mkdir()
    with pytest.raises(DriveError, match=r"holds no \.bin file") as caught:
        Drive(tmp_path)
    assert isinstance(caught.value, CosimError)
    assert "\n" not in str(caught.value)
    (tmp_path / "file").write_text("")
    with pytest.raises(DriveError, match="not a folder"):
        Drive(tmp_path / "file")


def test_kittis_own_layout_is_a_measured_drive(kitti_root: Path) -> None:
    drive = Drive(kitti_root)
    assert drive.kind == "measured"
    assert drive.root == kitti_root / "training"
    assert drive.frames == Drive(kitti_root / "training").frames
    assert drive.split("train") == drive.frames[:2] == Drive(kitti_root / "training").split("train")
    assert drive[drive.frames[0]].image().shape[2] == 3

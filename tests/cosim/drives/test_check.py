"""`cosim check`: damage is found by checksums and repaired by recording only those frames again."""

import json
import shutil

import pytest
import yaml

from cosim.cli import main
from tests.cosim.capture.test_run import checksums
from tests.cosim.conftest import cosim, refused


@pytest.fixture
def copy(blind_drive, tmp_path):
    return shutil.copytree(blind_drive, tmp_path / "drive")


def test_a_whole_drive_passes(blind_drive, capsys):
    before = checksums(blind_drive)
    assert main(["check", str(blind_drive)]) == 0
    assert "all as they were written" in capsys.readouterr().err
    assert checksums(blind_drive) == before


def test_damaged_frames_and_shared_files_are_made_again_to_the_same_bytes(copy, blind_drive, tmp_path):
    (copy / "velodyne/000002.bin").unlink()
    (copy / "rays/000002.npz").write_bytes(b"")
    with (copy / "twin/static.glb").open("r+b") as file:
        file.seek(5000)
        file.write(b"\0\1\2\3")
    (copy / "pattern.yaml").write_text("name: other\n")
    found = tmp_path / "found.json"
    report = refused("check", copy, "--no-repair", "--quiet")
    assert "4 of" in report and "are damaged" in report
    cosim("check", copy, "--json", found)
    damaged = json.loads(found.read_text())
    assert damaged["damaged"] == {
        "velodyne/000002.bin": "missing",
        "rays/000002.npz": "changed",
        "twin/static.glb": "changed",
        "pattern.yaml": "changed",
    }
    assert "000002" in damaged["repaired"] and len(damaged["repaired"]) <= 2
    assert checksums(copy) == checksums(blind_drive)


def test_a_frame_that_comes_out_differently_is_said_so(copy):
    manifest = copy / "manifest.jsonl"
    lines = manifest.read_text().splitlines(keepends=True)
    entry = json.loads(lines[1])
    entry["sha256"][0] = "0" * 64
    manifest.write_text("".join([lines[0], json.dumps(entry) + "\n", *lines[2:]]))
    result = cosim("check", copy, check=False)
    assert result.returncode == 2 and "1 frames came out differently" in result.stderr


def test_other_versions_do_not_pretend_to_repair(copy):
    (copy / "velodyne/000002.bin").unlink()
    summary = copy / "drive.yaml"
    summary.write_text(summary.read_text().replace("eclipse-sumo: ", "eclipse-sumo: 0."))
    assert "eclipse-sumo: 0." in refused("check", copy, "--quiet")


@pytest.mark.parametrize("name", ["../outside.bin", "/etc/passwd", "velodyne/../../x"])
def test_a_manifest_cannot_point_outside(copy, name):
    manifest = copy / "manifest.jsonl"
    lines = manifest.read_text().splitlines(keepends=True)
    entry = json.loads(lines[0])
    entry["files"][0] = name
    manifest.write_text(json.dumps(entry) + "\n" + "".join(lines[1:]))
    assert "no path within the drive" in refused("check", copy)


def test_folders_without_checksums_are_refused(tmp_path):
    assert "no manifest.jsonl" in refused("check", tmp_path)


def test_a_damaged_summary_is_named(copy):
    (copy / "drive.yaml").write_text("- 1\n")
    assert "drive.yaml: holds list, not keys with values" in refused("check", copy)


def test_checksums_of_shared_files_are_in_the_summary(blind_drive):
    sums = yaml.safe_load((blind_drive / "drive.yaml").read_text())["sha256"]
    assert {"twin/static.glb", "twin/materials.yaml", "sensor.yaml", "pattern.yaml"} <= set(sums)
    assert not any(name.startswith(("velodyne/", "drive.yaml", "manifest")) for name in sums)

import errno
import json
import multiprocessing
import os
from pathlib import Path

import pytest

from cosim.drives.writer import MANIFEST, SUMMARY, UNFINISHED, DriveWriter, OutputError

SETTINGS = "kind: simulated\nconfig:\n  seed: 1\n"


def started(folder: Path) -> DriveWriter:
    writer = DriveWriter(folder)
    assert writer.open(SETTINGS) is False
    return writer


def contents(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_a_frame_is_listed_with_the_checksums_of_its_files(tmp_path):
    writer = started(tmp_path / "d")
    writer.write_frame("000000", {"velodyne/000000.bin": b"abc"}, {"points": 3})
    entry = writer.manifest()["000000"]
    assert entry["counts"] == {"points": 3}
    assert entry["files"] == ["velodyne/000000.bin"]
    assert entry["sha256"] == ["ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"]
    assert (tmp_path / "d/velodyne/000000.bin").read_bytes() == b"abc"


def test_finishing_sorts_the_manifest_and_leaves_no_marks_of_the_run(tmp_path):
    writer = started(tmp_path / "d")
    for name in ("000002", "000000", "000001"):
        writer.write_frame(name, {f"velodyne/{name}.bin": name.encode()}, {})
    writer.finish({"ImageSets/train.txt": b"000000\n"}, SETTINGS + "counts: {}\n")
    assert list(writer.manifest()) == ["000000", "000001", "000002"]
    assert contents(tmp_path / "d") == {
        MANIFEST,
        SUMMARY,
        "ImageSets/train.txt",
        *(f"velodyne/00000{i}.bin" for i in range(3)),
    }
    assert DriveWriter(tmp_path / "d").open(SETTINGS) is True


def test_a_torn_last_line_is_cut_off_and_its_frame_is_not_done(tmp_path):
    writer = started(tmp_path / "d")
    writer.write_frame("000000", {"a": b"1"}, {})
    writer.write_frame("000001", {"b": b"2"}, {})
    path = tmp_path / "d" / MANIFEST
    path.write_bytes(path.read_bytes()[:-9])
    again = started(tmp_path / "d")
    assert list(again.manifest()) == ["000000"]
    again.write_frame("000001", {"b": b"2"}, {})
    assert [json.loads(line)["name"] for line in path.read_text().splitlines()] == ["000000", "000001"]


def test_half_written_files_of_an_interrupted_run_are_cleared(tmp_path):
    writer = started(tmp_path / "d")
    writer.write("velodyne/000000.bin", b"whole")
    (tmp_path / "d/velodyne/.000001.bin.123.partial").write_bytes(b"ha")
    started(tmp_path / "d")
    assert contents(tmp_path / "d") == {UNFINISHED, "velodyne/000000.bin"}


def test_what_a_killed_process_left_half_written_is_no_part_of_the_drive(tmp_path):
    drives = {}
    for name in ("calm", "killed"):
        writer = started(tmp_path / name)
        writer.write_frame("000000", {"velodyne/000000.bin": b"abc"}, {})
        if name == "killed":
            (tmp_path / name / "velodyne/.000000.bin.elsewhere-123.partial").write_bytes(b"ab")
        writer.finish({}, SETTINGS)
        drives[name] = contents(tmp_path / name), (tmp_path / name / SUMMARY).read_bytes()
    assert drives["killed"] == drives["calm"]


def test_an_unfinished_drive_only_goes_on_with_its_own_settings(tmp_path):
    started(tmp_path / "d")
    with pytest.raises(OutputError, match=r"seed: 1.*seed: 2.*another --out"):
        DriveWriter(tmp_path / "d").open(SETTINGS.replace("1", "2"))


def test_a_foreign_folder_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(OutputError, match="is not empty and holds no drive"):
        DriveWriter(tmp_path).open(SETTINGS)
    assert contents(tmp_path) == {"thesis.tex"}


def test_a_file_instead_of_the_folder_is_named(tmp_path):
    (tmp_path / "d").write_text("a file")
    with pytest.raises(OutputError, match=r"cannot write .*d: .*another --out"):
        DriveWriter(tmp_path / "d").open(SETTINGS)


def test_a_full_disk_keeps_finished_frames_and_leaves_nothing_half_written(tmp_path, monkeypatch):
    writer = started(tmp_path / "d")
    writer.write_frame("000000", {"velodyne/000000.bin": b"safe"}, {})

    def full(descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match=r"no space left.*000001\.bin.*finished frames are kept"):
        writer.write_frame("000001", {"velodyne/000001.bin": b"lost"}, {})
    monkeypatch.undo()
    assert contents(tmp_path / "d") == {UNFINISHED, MANIFEST, "velodyne/000000.bin"}
    assert list(writer.manifest()) == ["000000"]


def test_a_real_full_device_is_reported():
    if not Path("/dev/full").exists():
        pytest.skip("this system has no /dev/full")
    with pytest.raises(OutputError, match="no space left"):
        DriveWriter(Path("/dev"))._append_to(Path("/dev/full"), "line\n")


def _append_many(folder: Path, worker: int) -> None:
    writer = DriveWriter(folder)
    for number in range(25):
        name = f"{worker}{number:05d}"
        writer.write_frame(name, {f"velodyne/{name}.bin": bytes(2000)}, {}, filler="x" * 3000)


def test_two_processes_may_write_at_once(tmp_path):
    writer = started(tmp_path / "d")
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=_append_many, args=(tmp_path / "d", worker)) for worker in (1, 2)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(60)
        assert process.exitcode == 0
    assert len(writer.manifest()) == 50

"""The main job from the command line: files, resumption, and what bad input gets."""

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from cosim.cli import main
from tests.cosim.conftest import refused
from tests.sharing import record


def checksums(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def start_run(config: Path, folder: Path, *options: str) -> subprocess.Popen[str]:
    code = "import sys; from cosim.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", code, "run", str(config), "--out", str(folder), "--quiet", *options]
    return subprocess.Popen(command, start_new_session=True, stderr=subprocess.PIPE, text=True)


def linked(drive: Path, folder: Path) -> Path:
    """A copy of a drive for another run: its files are links."""
    return shutil.copytree(drive, folder / "drive", copy_function=os.link)


def wait_for_frames(folder: Path, count: int, process: subprocess.Popen[str]) -> None:
    manifest = folder / "manifest.jsonl"
    deadline = time.monotonic() + 300
    while not manifest.is_file() or manifest.read_bytes().count(b"\n") < count:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.01)


def children_of(process: subprocess.Popen[str]) -> list[int]:
    tasks = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    return [int(word) for word in tasks.read_text().split()]


def test_a_drive_has_every_part_of_every_frame(drive_folder):
    names = [f"{number:06d}" for number in range(8)]
    parts = {
        "velodyne": ".bin",
        "rays": ".npz",
        "hits": ".npz",
        "image_0": ".png",
        "image_2": ".png",
        "depth_0": ".png",
        "calib": ".txt",
        "label_2": ".txt",
        "oxts": ".txt",
        "twin/frames": ".json",
    }
    for part, suffix in parts.items():
        assert sorted(path.name for path in (drive_folder / part).iterdir()) == [name + suffix for name in names], part
    for name in (
        "drive.yaml",
        "manifest.jsonl",
        "pattern.yaml",
        "sensor.yaml",
        "twin/static.glb",
        "twin/materials.yaml",
    ):
        assert (drive_folder / name).is_file(), name
    assert (drive_folder / "ImageSets/trainval.txt").read_text().split() == names
    halves = [(drive_folder / f"ImageSets/{split}.txt").read_text().split() for split in ("train", "val")]
    assert halves == [names[:4], names[4:]]
    summary = yaml.safe_load((drive_folder / "drive.yaml").read_text())
    assert summary["kind"] == "simulated" and summary["counts"]["frames"] == 8 and summary["seed"] == 3


def test_files_stay_within_their_sizes(drive_folder):
    for name in (f"{number:06d}" for number in range(8)):
        sizes = {path: path.stat().st_size for path in drive_folder.rglob(f"{name}.*")}
        hits = sum(size for path, size in sizes.items() if path.parent.name == "hits")
        assert hits <= 1.5e6
        assert sum(sizes.values()) - hits <= 3.2e6  # two thirds of it points: few lasers see the sky


def test_a_run_killed_half_way_goes_on_to_the_same_bytes(blind_drive, blind_config, tmp_path):
    folder = tmp_path / "killed"
    process = start_run(blind_config, folder)
    wait_for_frames(folder, 3, process)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    kept = (folder / "manifest.jsonl").read_bytes().count(b"\n")
    assert 3 <= kept < 8 and not (folder / "drive.yaml").exists()
    record(blind_config, folder)
    assert checksums(folder) == checksums(blind_drive)


def test_a_second_run_is_refused_and_a_recording_process_that_is_killed_is_replaced(
    blind_drive, blind_config, tmp_path
):
    folder = tmp_path / "drive"
    process = start_run(blind_config, folder)
    wait_for_frames(folder, 1, process)
    os.killpg(process.pid, signal.SIGSTOP)  # otherwise it may end before the second one starts
    message = refused("run", blind_config, "--out", folder, "--quiet")
    assert f"another run (process {process.pid} on " in message
    (child,) = children_of(process)
    os.kill(child, signal.SIGKILL)
    os.killpg(process.pid, signal.SIGCONT)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0 and "is retried" in errors and "killed by signal 9" in errors
    assert checksums(folder) == checksums(blind_drive)


def test_a_finished_drive_is_left_as_it_is(blind_drive, blind_config, tmp_path):
    folder = linked(blind_drive, tmp_path)
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}
    assert main(["run", str(blind_config), "--out", str(folder), "--quiet"]) == 0
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()} == before


def test_another_seed_gives_another_drive_and_is_refused_in_the_same_folder(blind_drive, blind_config, tmp_path):
    message = refused("run", blind_config, "--seed", 4, "--out", linked(blind_drive, tmp_path))
    assert "seed: 3" in message and "seed: 4" in message


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--town", "atlantis"], "town 'atlantis' does not exist; choose one of town01"),
        (["--frames", "0"], "frames: Input should be greater than or equal to 1 (got 0)"),
        (["--frames", "ten"], "invalid int value: 'ten'"),
        (["--sensor", "hdl65"], "sensor 'hdl65' does not exist"),
        (["--workers", "0"], "workers is 0; give 1 or more"),
        (["--colour=red"], "unrecognized arguments: --colour=red"),
        (["missing.yaml"], "cannot read missing.yaml"),
    ],
)
def test_bad_input_gets_one_line_and_exit_code_2(tmp_path, arguments, complaint):
    assert complaint in refused("run", *arguments, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_foreign_output_folder_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    assert "is not empty and holds no drive" in refused("run", "--frames", 1, "--out", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_folder_that_cannot_be_written_is_named():
    assert "cannot write /proc/drive" in refused("run", "--frames", 1, "--out", "/proc/drive")


def test_a_scenario_that_sumo_refuses_is_named(tmp_path):
    (tmp_path / "broken.net.xml").write_text("<net><edge id='a' from='x' to='y'/></net>")
    (tmp_path / "broken.sumocfg").write_text(
        "<configuration><input><net-file value='broken.net.xml'/></input></configuration>"
    )
    assert "broken" in refused("run", "--town", tmp_path / "broken.sumocfg", "--out", tmp_path / "out")


def test_an_empty_disk_is_reported_and_nothing_finished_is_lost(blind_drive, blind_config, tmp_path):
    """On a small file system of its own, where mounting one is permitted."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if (
        shutil.which("mount") is None
        or subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=60m", "tmpfs", str(disk)], capture_output=True
        ).returncode
    ):
        pytest.skip("this user may not mount a small file system")
    try:
        (disk / "ballast").write_bytes(bytes(59_000_000))
        assert "the run needs about" in refused("run", blind_config, "--out", disk / "drive", "--quiet")
        (disk / "ballast").unlink()
        process = start_run(blind_config, disk / "drive")
        wait_for_frames(disk / "drive", 3, process)
        with pytest.raises(OSError, match="No space left"), (disk / "ballast").open("wb", buffering=0) as ballast:
            while True:
                ballast.write(bytes(100_000))
        _, errors = process.communicate(timeout=300)
        assert process.returncode == 2 and "no space left" in errors and errors.count("\n") == 1
        written = checksums(disk / "drive")
        whole = checksums(blind_drive)
        kept = {name for name in written if name.startswith("velodyne/")}
        assert kept and all(written[name] == whole[name] for name in kept)
        assert not any(name.endswith(".partial") for name in written)
        (disk / "ballast").unlink()
        record(blind_config, disk / "drive")
        assert checksums(disk / "drive") == whole
    finally:
        subprocess.run(["umount", str(disk)], check=True)

"""`cosim view` as a user calls it: what it writes, what it says, how it refuses."""

from __future__ import annotations

import importlib.util
import re
import shutil
import signal
import socket
import subprocess
import sys
import urllib.request
from itertools import pairwise
from pathlib import Path

import pytest

from cosim.cli import main
from cosim.drives.kitti import Drive
from cosim.view.interactive import show_drives


def names_in(page: Path) -> list[str]:
    return re.findall(r'data-frame="0" data-name="(\d+)"', page.read_text(encoding="utf-8"))


def test_a_folder_gets_the_page_and_one_of_pictures(labelled_drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["view", str(labelled_drive), "--out", str(out), "--quiet"]) == 0
    assert names_in(out / "index.html") == ["000000", "000001", "000002"]
    assert 'href="pictures.html"' in (out / "index.html").read_text(encoding="utf-8")
    assert (out / "pictures.html").is_file() and any((out / "pictures").iterdir())


def test_a_file_is_all_there_is(labelled_drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "out" / "page.html"
    assert main(["view", str(labelled_drive), "--out", str(page), "--frames", "2"]) == 0
    assert [file.name for file in page.parent.iterdir()] == ["page.html"]
    assert names_in(page) == ["000000", "000002"]
    message = capsys.readouterr().err
    assert "2 of 3 frames" in message and "show all with --serve" in message
    assert not re.search(r'(?:src|href)="|https?://|@import', page.read_text(encoding="utf-8"))


def test_of_many_frames_a_file_holds_twelve_spread_evenly(bare_drive: Path, tmp_path: Path) -> None:
    for number in range(3, 40):
        for part, suffix in (("velodyne", ".bin"), ("calib", ".txt")):
            shutil.copyfile(bare_drive / part / f"000000{suffix}", bare_drive / part / f"{number:06d}{suffix}")
    page = tmp_path / "page.html"
    assert main(["view", str(bare_drive), "--out", str(page), "--quiet"]) == 0
    shown = [int(name) for name in names_in(page)]
    assert len(shown) == 12 and shown[0] == 0 and shown[-1] == 39
    assert {later - earlier for earlier, later in pairwise(shown)} <= {3, 4}


def test_two_drives_go_together_by_name_where_one_holds_all_names_of_the_other(
    labelled_drive: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other"
    shutil.copytree(labelled_drive, other)
    (other / "velodyne" / "000001.bin").unlink()
    one, two = Drive(labelled_drive), Drive(other)
    assert show_drives([one, two], None, None, None, for_file=True).steps == (("000000",) * 2, ("000002",) * 2)
    (other / "velodyne" / "000002.bin").rename(other / "velodyne" / "000007.bin")
    (other / "calib" / "000002.txt").rename(other / "calib" / "000007.txt")
    shown = show_drives([one, Drive(other)], None, None, None, for_file=True)
    assert shown.steps == (("000000", "000000"), ("000001", "000007"))
    assert "order" in shown.notes[0]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--frames", "000009"], "no frame '000009'"),
        (["--frames", "0"], "no frame '0'"),
        (["--frames", ","], "above 0"),
        (["--serve", "--out", "x.html"], "leave out"),
        (["--sensor", "hdl64e"], "needs a twin"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    labelled_drive: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    assert main(["view", str(labelled_drive), *arguments]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


@pytest.mark.skipif(importlib.util.find_spec("rerun") is not None, reason="rerun-sdk is installed")
def test_without_rerun_the_extra_is_named(labelled_drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", str(labelled_drive), "--rerun"]) == 2
    assert "cosim[rerun]" in capsys.readouterr().err


@pytest.mark.skipif(importlib.util.find_spec("rerun") is None, reason="rerun-sdk is not installed")
def test_rerun_gets_points_boxes_and_images(labelled_drive: Path, tmp_path: Path) -> None:
    file = tmp_path / "drive.rrd"
    assert main(["view", str(labelled_drive), "--rerun", "--out", str(file), "--quiet"]) == 0
    data = file.read_bytes()
    for path in (b"ego/lidar/points", b"ego/lidar/labels", b"ego/lidar/image_2"):
        assert path in data


def _heed_interrupts() -> None:
    """As in a terminal: what a shell starts in the background ignores them."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_serving_says_where_and_ends_on_interrupt(labelled_drive: Path) -> None:
    command = [sys.executable, "-c", "import sys; from cosim.cli import main; sys.exit(main())"]
    process = subprocess.Popen(
        [*command, "view", str(labelled_drive), "--serve", "--port", "0", "--quiet"],
        stdout=subprocess.PIPE,
        text=True,
        env={"PATH": "/nowhere", "PYTHONPATH": str(Path(__file__).parents[3])},
        preexec_fn=_heed_interrupts,
    )
    assert process.stdout is not None
    try:
        address = process.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", address)
        with urllib.request.urlopen(address, timeout=30) as answer:
            assert b"<canvas" in answer.read()
        process.send_signal(2)
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_a_port_in_use_is_one_line(labelled_drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        assert main(["view", str(labelled_drive), "--serve", "--port", str(taken.getsockname()[1])]) == 2
    assert "choose another --port" in capsys.readouterr().err

"""The page lists what there is, names what there is not, and survives any name."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

from cosim.drives.kitti import Drive, read_image
from cosim.drives.writer import OutputError
from cosim.errors import DriveError
from cosim.view import choose_frames, write_view
from cosim.view.captions import Caption
from cosim.view.page import FrameSection, Missing, Page, ShownPicture, Thumbnail, format_page

NASTY = "<script>\"'&{0}"


class _References(HTMLParser):
    """Collects what the page refers to."""

    def __init__(self) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.targets: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        for name, value in attrs:
            if name == "src":
                self.sources.append(unquote(value or ""))
            if name == "href":
                self.targets.append(unquote(value or ""))


def _references(index: Path) -> _References:
    parser = _References()
    parser.feed(index.read_text(encoding="utf-8"))
    return parser


def _pictures(folder: Path) -> set[str]:
    return {f"pictures/{file.name}" for file in (folder / "pictures").iterdir()}


def test_the_page_shows_every_picture_that_exists_and_no_other(labelled_drive: Path, tmp_path: Path) -> None:
    drive = Drive(labelled_drive)
    index = write_view(drive, ("000001",), tmp_path / "out")
    found = _references(index)
    assert set(found.sources) == _pictures(tmp_path / "out")
    assert {target for target in found.targets if not target.startswith("#")} <= set(found.sources)
    assert "script" not in found.tags
    keys = {re.sub(r"^pictures/\d+-|\.png$", "", source) for source in found.sources}
    assert {"camera-boxes", "camera-depth", "perspective-intensity", "above-instance", "range", "close-ups"} <= keys


def test_pictures_have_the_size_the_page_says(labelled_drive: Path, tmp_path: Path) -> None:
    index = write_view(Drive(labelled_drive), ("000001",), tmp_path / "out")
    sizes = re.findall(r'src="([^"]+)" width="(\d+)" height="(\d+)"', index.read_text(encoding="utf-8"))
    assert sizes
    for file, width, height in sizes:
        image = read_image(tmp_path / "out" / unquote(file))
        assert image.shape[:2] == (int(height), int(width))
        assert image.any()


def test_a_drive_of_points_alone_has_a_page_that_says_what_is_left_out(bare_drive: Path, tmp_path: Path) -> None:
    index = write_view(Drive(bare_drive), ("000000",), tmp_path / "out")
    text = index.read_text(encoding="utf-8")
    assert set(_references(index).sources) == _pictures(tmp_path / "out")
    assert "there is no image_2/ or image_0/" in text
    assert "there are neither labels nor a twin" in text
    assert "label_2/ is absent" in text


def test_a_scan_without_points_has_a_page(bare_drive: Path, tmp_path: Path) -> None:
    (bare_drive / "velodyne" / "000000.bin").write_bytes(b"")
    assert write_view(Drive(bare_drive), ("000000",), tmp_path / "out").is_file()


def test_a_scan_in_another_order_has_no_range_image_and_the_rest(
    bare_drive: Path, tmp_path: Path, scan: np.ndarray
) -> None:
    shuffled = np.random.default_rng(1).permutation(scan)
    (bare_drive / "velodyne" / "000000.bin").write_bytes(shuffled.tobytes())
    found = _references(write_view(Drive(bare_drive), ("000000",), tmp_path / "out"))
    assert "pictures/000000-range.png" not in found.sources
    assert "pictures/000000-above-intensity.png" in found.sources


def test_a_second_page_leaves_no_pictures_of_the_first_but_all_other_files(
    labelled_drive: Path, tmp_path: Path
) -> None:
    drive, out = Drive(labelled_drive), tmp_path / "out"
    write_view(drive, ("000001",), out)
    (out / "pictures" / "mine.png").write_bytes(b"mine")
    index = write_view(drive, ("000002",), out)
    assert _pictures(out) - set(_references(index).sources) == {"pictures/mine.png"}


def test_the_same_drive_gives_the_same_bytes(labelled_drive: Path, tmp_path: Path) -> None:
    drive = Drive(labelled_drive)
    one, two = (write_view(drive, ("000001",), tmp_path / name).parent for name in ("one", "two"))
    for file in sorted(path.relative_to(one) for path in one.rglob("*") if path.is_file()):
        assert (one / file).read_bytes() == (two / file).read_bytes()


def test_odd_names_are_escaped() -> None:
    caption = Caption("key", NASTY, NASTY)
    shown = ShownPicture(f"pictures/{NASTY} x.png", caption, 10, 10)
    section = FrameSection(NASTY, [(NASTY, NASTY)], [shown], [Missing(NASTY, NASTY)])
    thumbnail = Thumbnail(NASTY, f"pictures/{NASTY}.png", 10, 10, True)
    text = format_page(Page(NASTY, [(NASTY, NASTY)], [NASTY], [thumbnail], [section]))
    parser = _References()
    parser.feed(text)
    assert "script" not in parser.tags
    assert parser.sources == [thumbnail.file, shown.file]
    assert f"#frame-{NASTY}" in {unquote(target) for target in parser.targets}


def test_an_unwritable_folder_is_one_line(bare_drive: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot write"):
        write_view(Drive(bare_drive), ("000000",), tmp_path / "file" / "out")


def test_a_number_spreads_frames_over_the_drive_and_takes_the_richest(labelled_drive: Path) -> None:
    drive = Drive(labelled_drive)
    assert choose_frames(drive, "1") == ("000001",)
    assert choose_frames(drive, "3") == drive.frames
    assert choose_frames(drive, "99") == drive.frames
    assert choose_frames(drive, "000002, 000000") == ("000002", "000000")
    assert choose_frames(drive, "000002") == ("000002",)


@pytest.mark.parametrize("wanted", ["000009", "", "-1", "0", "201", "a,b"])
def test_frames_that_are_not_there_are_refused(labelled_drive: Path, wanted: str) -> None:
    with pytest.raises(DriveError):
        choose_frames(Drive(labelled_drive), wanted)


def test_real_frames_give_all_pictures_but_depth(kitti_root: Path, tmp_path: Path) -> None:
    drive = Drive(kitti_root)
    index = write_view(drive, drive.frames[:1], tmp_path / "out")
    assert set(_references(index).sources) == _pictures(tmp_path / "out")
    assert "there is no depth_0/" in index.read_text(encoding="utf-8")
    assert index.read_text(encoding="utf-8").count("<figure") == 9

"""Makes the pictures of README and docs, from drives that it records: `python -m tools.pictures` (`make pictures`).

python -m tools.pictures                                      all pictures of recorded drives, into docs/img/
python -m tools.pictures page PAGE.html PICTURE.jpg           a page of cosim compare or diagnose, as a browser shows it
python -m tools.pictures page PAGE.html PICTURE.png --mark 20,60 ...   the same, with a number at each such place
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import yaml
from PIL import Image

from cosim.drives.kitti import Drive
from cosim.town_map import write_town_page
from cosim.view import richest_frames
from cosim.view.captions import CAMERA_BOXES, PERSPECTIVE_INSTANCE, PERSPECTIVE_INTENSITY, RANGE, Caption
from cosim.view.frame_pictures import FramePictures, Picture, intensity_scale
from cosim.view.range_image import MARGIN_PX
from sumo_nets import TOWNS, read_town
from tools.level_towns import INTERCHANGE, OVERPASS, UNDERPASS, write_crossing

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "img"
STILL = {"town": "town01", "frames": 12, "sensor": "kitti", "store_hits": False}
MOVING = {
    "town": "town02",
    "frames": 10,
    "frames_per_episode": 10,
    "seed": 11,
    "sensor": "kitti",
    "warm_up_s": 40,
    "collection": {"every_s": 0.4, "min_travel_m": 0.5, "company_m": 25},
    "store_hits": False,
}
LEVELS = {
    "overpass": (OVERPASS, {"x_m": -50, "y_m": -12, "heading_deg": 8}, 9.0, 5.0),
    "underpass": (UNDERPASS, {"x_m": -48, "y_m": -13, "heading_deg": 8}, 9.0, 10.0),
    "interchange": (INTERCHANGE, {"x_m": -75, "y_m": -11, "heading_deg": 6}, 18.0, 8.0),
}  # network, mast, and height of its camera [m] and its pitch [deg]
RIGGED = {"town": "town01", "frames": 3, "seed": 3, "warm_up_s": 30, "store_hits": False}
_LIDAR_COLOURS = ((64, 190, 255), (255, 210, 60), (255, 90, 200))
_ROW_PX = (1600, 450)
_GAP_PX = 8
_DISC_PX, _DISC = 19, (192, 57, 125)
RINGS, RING_PX = 64, 6  # of the sensor that records, and rows of pixels each has in a range image
_CHROMIUMS = ("chromium", "chromium-browser", "google-chrome")


def main(arguments: list[str] | None = None) -> None:
    """Make the requested pictures."""
    parser = argparse.ArgumentParser(prog="python -m tools.pictures", description=__doc__)
    commands = parser.add_subparsers(dest="what")
    page = commands.add_parser("page", help="a page as a browser shows it")
    page.add_argument("page", type=Path)
    page.add_argument("picture", type=Path)
    page.add_argument("--width", type=int, default=1100)
    page.add_argument("--height", type=int, default=1400)
    page.add_argument("--mark", action="append", default=[], metavar="X,Y", help="position of the next number [px]")
    page.add_argument("--scale", type=float, default=1.0, help="of the picture, 1 as the browser shows it")
    scan = commands.add_parser("scan", help="a frame of a drive")
    scan.add_argument("drive", type=Path)
    scan.add_argument("picture", type=Path)
    parser.add_argument("--drives", type=Path, default=ROOT / "out" / "pictures", help="where drives are recorded")
    parser.add_argument("--frame", help="of the drive (default: the one that shows most)")
    options = parser.parse_args(arguments)
    if options.what == "page":
        marks = [(int(x), int(y)) for x, y in (mark.split(",") for mark in options.mark)]
        write_page_picture(options.page, options.picture, options.width, options.height, marks, options.scale)
        return
    if options.what == "scan":
        drive = Drive(options.drive)
        name = options.frame or _richest(drive)
        write_jpeg(options.picture, stacked(drawn(drive, name), width=1000))
        return
    still, moving = (record(options.drives / name, config) for name, config in (("still", STILL), ("moving", MOVING)))
    write_row(still, options.frame, IMAGES / "drive.jpg")
    write_scan(still, options.frame, IMAGES / "objects.jpg")
    write_animation(moving, IMAGES / "drive.webp")
    write_towns(options.drives / "towns", IMAGES / "towns.jpg")
    for name in LEVELS:
        write_levels(record_levels(options.drives, name), IMAGES / f"{name}.jpg")
    rigs = [record(options.drives / name, {**RIGGED, "rig": name}) for name in ("nuscenes_like", "roof_three", "mast")]
    write_rigs(rigs, IMAGES / "rigs.jpg")


def record(folder: Path, config: dict[str, object]) -> Drive:
    """The drive of a configuration; an existing one is used."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    path = folder.with_suffix(".yaml")
    path.write_text(yaml.safe_dump(config), encoding="utf-8")
    code = "import sys; from cosim.cli import main; sys.exit(main())"
    subprocess.run([sys.executable, "-c", code, "run", str(path), "--out", str(folder)], check=True)
    return Drive(folder)


def write_row(drive: Drive, frame: str | None, path: Path) -> None:
    """Scan by intensity; next to it the camera image with its labels above the range image."""
    pictures = drawn(drive, frame or _richest(drive))
    width, height = _ROW_PX
    left = _filling(pictures[PERSPECTIVE_INTENSITY], width // 2, height)
    wide = width - width // 2 - _GAP_PX
    camera = _scaled(pictures[CAMERA_BOXES], wide)
    size = (wide, height - len(camera) - _GAP_PX)
    below = cv2.resize(_front_half(pictures[RANGE]), size, interpolation=cv2.INTER_AREA)
    row = np.full((height, width, 3), 255, np.uint8)
    row[:, : width // 2] = left
    row[: len(camera), width // 2 + _GAP_PX :] = camera
    row[len(camera) + _GAP_PX :, width // 2 + _GAP_PX :] = below
    write_jpeg(path, row)


def write_scan(drive: Drive, frame: str | None, path: Path) -> None:
    """A scan in which every object has its colour."""
    picture = drawn(drive, frame or _richest(drive))[PERSPECTIVE_INSTANCE]
    write_jpeg(path, _scaled(picture, 1100))


def record_levels(folder: Path, name: str) -> Drive:
    """A drive of a mast's LiDAR and camera that look at a crossing with several levels."""
    crossing, mast, height_m, pitch_deg = LEVELS[name]
    mount = {"z_m": height_m, "pitch_deg": pitch_deg}
    image = {"labels": True, "width_px": 1600, "height_px": 800, "K": [[1000, 0, 799.5], [0, 1000, 399.5], [0, 0, 1]]}
    rig = {
        "carrier": "mast",
        "lidars": [{"name": "mast", "sensor": "os1_128", "mount": {**mount, "x_m": 0.3}}],
        "cameras": [{"name": "mast", **image, "mount": {**mount, "x_m": 0.4}}],
    }
    town = write_crossing(crossing, folder / f"{name}_town")
    config = {"town": str(town), "rig": rig, "mast": mast, "frames": 4, "frames_per_episode": 4, "seed": 1}
    config |= {"warm_up_s": 35, "collection": {"every_s": 3.0}, "annotators": {"enabled": False}, "store_hits": False}
    return record(folder / name, config)


def write_levels(drive: Drive, path: Path) -> None:
    """The frame with most labelled objects: the camera image above the scan."""
    name = max(drive.frames, key=lambda frame: len(drive[frame].labels.cared_for))
    write_jpeg(path, stacked(drawn(drive, name), 1000), quality=80)


def write_animation(drive: Drive, path: Path, width: int = 900) -> None:
    """The frames of a drive one after another: the camera above the scan, as animated WebP."""
    scale = intensity_scale(drive, drive.frames)
    animation = cv2.Animation()
    frames = []
    for name in drive.frames:
        frames.append(cv2.cvtColor(stacked(drawn(drive, name, scale), width), cv2.COLOR_RGB2BGR))
    animation.frames = frames
    animation.durations = np.full(len(frames), 400)
    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, 60]):
        raise OSError(f"{path} could not be written; give a folder that can be")


def write_towns(folder: Path, path: Path) -> None:
    """The nine towns as `cosim towns show` draws them."""
    page = write_town_page([read_town(name) for name in TOWNS], folder)
    write_page_picture(page, path, width=1500, height=1240)


def write_rigs(drives: Sequence[Drive], path: Path, width: int = 1500) -> None:
    """Camera images of rigs with the points of all their LiDARs, one colour each: six in two rows, two next to them."""
    tiles = [
        _seen(drive, drive.frames[-1], name) for drive in drives for name in drive[drive.frames[-1]].calibration.named
    ]
    around, others = tiles[:6], tiles[6:]
    rows = [around[1::-1] + around[2:3], [around[4], around[3], around[5]], others]  # left, ahead, right
    height = width // len(rows[0]) * 9 // 16
    fitted = [[_filling(tile, width // len(row), height * len(rows[0]) // len(row)) for tile in row] for row in rows]
    write_jpeg(path, np.concatenate([np.concatenate(row, 1) for row in fitted]))


def _seen(drive: Drive, name: str, camera: str) -> np.ndarray:
    """A camera's image with points."""
    image = drive[name].image(f"image_{camera}").copy()
    for colour, one in zip(_LIDAR_COLOURS, (drive, *map(drive.of_lidar, drive.lidars)), strict=False):
        frame = one[name]
        u, v, depth = frame.calibration.to_pixels(camera) @ np.c_[frame.points[:, :3], np.ones(len(frame.points))].T
        before = depth > 0.5
        for x, y in np.rint(np.stack([u, v])[:, before] / depth[before]).T.astype(int).tolist():
            cv2.circle(image, (x, y), max(1, image.shape[1] // 640), colour, -1, cv2.LINE_AA)
    return image


def stacked(pictures: dict[Caption, np.ndarray], width: int) -> np.ndarray:
    """The camera image with its labels above the scan by intensity."""
    scan = _scaled(pictures[PERSPECTIVE_INTENSITY], width)[: width // 2]  # without the colour bar at its foot
    return np.concatenate([_scaled(pictures[CAMERA_BOXES], width), scan])


def drawn(drive: Drive, name: str, scale: object = None) -> dict[Caption, np.ndarray]:
    """The pictures of a frame, by caption."""
    scale = scale or intensity_scale(drive, (name,))
    return {one.caption: one.image for one in FramePictures(drive, name, scale) if isinstance(one, Picture)}


def write_page_picture(
    page: Path, picture: Path, width: int, height: int, marks: Sequence[tuple[int, int]] = (), scale: float = 1.0
) -> None:
    """The top of a page, as chromium shows it, with numbers at some places; scaled at last.

    Raises:
        FileNotFoundError: there is no such page, or no chromium.
    """
    program = next(filter(None, map(shutil.which, _CHROMIUMS)), None)
    if program is None:
        raise FileNotFoundError("no chromium here; install it: apt-get install chromium")
    if not page.is_file():
        raise FileNotFoundError(f"{page} does not exist; give a page that a command wrote")
    with tempfile.TemporaryDirectory(prefix="cosim-") as folder:
        shot = Path(folder) / "page.png"
        flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", f"--window-size={width},{height}"]
        command = [program, *flags, f"--screenshot={shot}", page.resolve().as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        image = cv2.cvtColor(cv2.imread(str(shot)), cv2.COLOR_BGR2RGB)
    numbered(image, marks)
    image = _scaled(image, round(scale * width))
    if picture.suffix == ".png":
        write_png(picture, image)
    else:
        write_jpeg(picture, image)


def numbered(image: np.ndarray, marks: Sequence[tuple[int, int]]) -> None:
    """Draw numbers from 1 on discs about places (x, y) [px] into an image (h, w, 3)."""
    for number, position in enumerate(marks, 1):
        cv2.circle(image, position, _DISC_PX, _DISC, -1, cv2.LINE_AA)
        cv2.circle(image, position, _DISC_PX, (255, 255, 255), 2, cv2.LINE_AA)
        (wide, high), _ = cv2.getTextSize(str(number), cv2.FONT_HERSHEY_SIMPLEX, 0.8, 2)
        corner = position[0] - wide // 2, position[1] + high // 2
        cv2.putText(image, str(number), corner, cv2.FONT_HERSHEY_SIMPLEX, 0.8, (255, 255, 255), 2, cv2.LINE_AA)


def write_png(path: Path, image: np.ndarray, colours: int = 160) -> None:
    """Write RGB pixels (h, w, 3) with a palette of few colours: sharp letters in a small file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    few = Image.fromarray(image).quantize(colours, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(path, optimize=True)


def write_jpeg(path: Path, image: np.ndarray, quality: int = 88) -> None:
    """Write RGB pixels (h, w, 3)."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(
        cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    )


def _richest(drive: Drive) -> str:
    return richest_frames(drive, drive.frames, 1)[0]


def _front_half(image: np.ndarray) -> np.ndarray:
    """Crop a range image of all azimuths to the front half, without its caption."""
    width = image.shape[1]
    return image[MARGIN_PX : MARGIN_PX + RINGS * RING_PX, width // 4 : width - width // 4]


def _scaled(image: np.ndarray, width: int) -> np.ndarray:
    return cv2.resize(image, (width, round(image.shape[0] * width / image.shape[1])), interpolation=cv2.INTER_AREA)


def _filling(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """An image scaled to cover a frame and cropped at the centre."""
    factor = max(width / image.shape[1], height / image.shape[0])
    size = (max(width, round(image.shape[1] * factor)), max(height, round(image.shape[0] * factor)))
    scaled = cv2.resize(image, size, interpolation=cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR)
    left, top = (size[0] - width) // 2, (size[1] - height) // 2
    return scaled[top : top + height, left : left + width]


if __name__ == "__main__":
    main()

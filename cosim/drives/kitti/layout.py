"""Locations of the parts of a drive: this project's layout and that of KITTI's downloads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from assets.documents import parse_json
from cosim.drives.files import is_safe_name, read_text
from cosim.drives.kitti.calibration import CAM_TO_CAM, VELO_TO_CAM
from cosim.errors import DriveError

_BELOW = ("", "training", "testing")
_SHOWN = 6  # folders in a message
LIDARS = "lidars"
"""Folder of a drive's additional LiDARs: each contains `velodyne/` and `calib/` and is a drive by itself."""
_RAW = {
    "velodyne": "velodyne_points/data",
    "oxts": "oxts/data",
    **{f"image_{camera}": f"image_{camera:02d}/data" for camera in range(4)},
}  # folders of a raw drive of KITTI (its development kit for raw data, readme.txt) by part


@dataclass(frozen=True)
class Layout:
    """The folders of a drive.

    Attributes:
        root: holds `velodyne/` and `calib/`.
        image_sets: folder of the lists of frames, next to the root or above it; None if there are none.
        base: folder of what all LiDARs of a drive share; the root except for additional LiDARs.
        lidar: name of such a LiDAR; empty for the first.
        parts: folder, relative to the root, of each part that is not in the folder of its name.
        calibration: file that holds for all frames; None if there is one a frame in `calib/`.
    """

    root: Path
    image_sets: Path | None
    base: Path
    lidar: str = ""
    parts: Mapping[str, str] = field(default_factory=dict)
    calibration: Path | None = None


def find_layout(path: Path) -> Layout:
    """The layout of the drive at `path`: its root, KITTI's folder above `training/` or `testing/`, or a raw drive.

    Raises:
        DriveError: no such folder, or no `velodyne/` or `calib/` in it.
    """
    if not path.is_dir():
        raise DriveError(f"{path}: {'not a folder' if path.exists() else 'no such folder'}; give that of a drive")
    root = next((path / below for below in _BELOW if holds_scans(path / below)), None)
    if root is None:
        raise DriveError(
            f"{path}: no velodyne/ here or in training/; a drive holds velodyne/NAME.bin and calib/NAME.txt: "
            f"{where_instead(path)}"
        )
    parts = {} if (root / "velodyne").is_dir() else _RAW
    calibration = None if (root / "calib").is_dir() else _common_calibration(root, parts)
    base, lidar = _base_of(root)
    above = [path, root.parent] if root.name in _BELOW[1:] else [base]
    image_sets = next((folder / "ImageSets" for folder in above if (folder / "ImageSets").is_dir()), None)
    return Layout(root, image_sets, base, lidar, parts, calibration)


def holds_scans(folder: Path) -> bool:
    """Whether a folder is the root of a drive, in the layout of a data set or of a raw drive of KITTI."""
    return (folder / "velodyne").is_dir() or (folder / _RAW["velodyne"]).is_dir()


def _common_calibration(root: Path, parts: Mapping[str, str]) -> Path:
    """The file of the calibration that holds for all frames.

    Raises:
        DriveError: there is none.
    """
    raw = [folder / VELO_TO_CAM for folder in (root, root.absolute().parent)] if parts else []
    found = next((file for file in (root / "calib.txt", *raw) if file.is_file()), None)
    if found is None:
        remedy = (
            f"a raw drive needs {VELO_TO_CAM} and {CAM_TO_CAM} here or in the folder above, as KITTI provides them"
            if parts
            else "every scan needs calib/NAME.txt, or all of them one calib.txt: add them in KITTI's format"
        )
        raise DriveError(f"{root}: no calib/; {remedy}")
    return found


def where_instead(path: Path) -> str:
    """What to give instead of a folder that is no drive: the folders in it that are."""
    folders = sorted(item for item in path.iterdir() if item.is_dir())
    found = [folder.name for folder in folders if any(holds_scans(folder / below) for below in _BELOW)]
    if not found:
        return "give the folder above them"
    return f"give one of the drives in it: {', '.join(found[:_SHOWN])}" + " …" * (len(found) > _SHOWN)


def lidar_folder(path: Path, name: str | None) -> Path:
    """Folder of one of a drive's additional LiDARs; the drive itself if no name is given.

    Raises:
        DriveError: there is no such LiDAR.
    """
    if name is None:
        return path
    found = path / LIDARS / name
    if not is_safe_name(name) or not (found / "velodyne").is_dir():
        folder = path / LIDARS
        known = sorted(item.name for item in folder.iterdir() if item.is_dir()) if folder.is_dir() else []
        raise DriveError(
            f"{path}: no LiDAR {name!r} in {LIDARS}/; there: {', '.join(known) or 'none'}, and the first, which needs "
            "no --lidar"
        )
    return found


def _base_of(root: Path) -> tuple[Path, str]:
    """Folder that the LiDARs of a drive share, and the LiDAR's name; the root itself for the main LiDAR."""
    folder = root.absolute()
    base = folder.parent.parent
    if folder.parent.name == LIDARS and (base / "velodyne").is_dir():
        return root.parent.parent if len(root.parts) > 2 else base, folder.name
    return root, ""


def list_scans(folder: Path) -> list[str]:
    """Names of the scans in `velodyne/`, sorted; files whose names could not be a frame's are passed over."""
    return sorted(file.stem for file in folder.glob("*.bin") if is_safe_name(file.stem))


def read_manifest(file: Path) -> list[str]:
    """Names of the finished frames in `manifest.jsonl`; a last line without its end is still being written.

    Raises:
        DriveError: a line is not an object with a plain `name`.
    """
    text = read_text(file)
    names = []
    for number, line in enumerate(text.splitlines(keepends=True), 1):
        if not line.endswith("\n") or not line.strip():
            continue
        try:
            entry = parse_json(line)
            if "name" not in entry and "episode" in entry:
                continue  # a remark about an episode
            name = entry["name"]
        except (ValueError, KeyError, TypeError):
            raise DriveError(f"{file}:{number}: not an object with a name; remove the line") from None
        names.append(_checked(name, f"{file}:{number}"))
    return names


def read_split(file: Path) -> list[str]:
    """Names of the frames in a list of `ImageSets/`, one a line.

    Raises:
        DriveError: a line is not a plain name.
    """
    lines = [(number, line.strip()) for number, line in enumerate(read_text(file).splitlines(), 1)]
    return [_checked(line, f"{file}:{number}") for number, line in lines if line]


def _checked(name: object, where: str) -> str:
    if not isinstance(name, str) or not is_safe_name(name):
        raise DriveError(f"{where}: {name!r} cannot be the name of a frame; use letters, digits and _ . + -")
    return name

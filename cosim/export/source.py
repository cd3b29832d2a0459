"""The drive that is exported: finished, cut into sequences, with ids of what its labels and points show."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
from scipy.optimize import linear_sum_assignment

from cosim.drives.kitti import Drive, Frame, points_in_boxes
from cosim.drives.kitti.boxes import Boxes
from cosim.drives.kitti.level import levelled
from cosim.drives.twin import TwinFrame
from cosim.drives.twin.origin import read_origins
from cosim.drives.writer import DriveWriter
from cosim.errors import CosimError

_SAME_OBJECT_M = 2.0  # between the middle of a label and of the object it labels


class ExportError(CosimError):
    """A drive cannot be exported."""


@dataclass(frozen=True, eq=False)
class Sequence:
    """Frames of one simulation, or of one recording, in order of time.

    Attributes:
        number: from 0.
        frames: at least one.
        time_s: (n,) seconds from the first frame.
    """

    number: int
    frames: tuple[Frame, ...]
    time_s: np.ndarray

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[Frame]:
        return iter(self.frames)

    @property
    def name(self) -> str:
        """Four digits, as KITTI's tracking sequences have."""
        return f"{self.number:04d}"


def open_finished(path: Path) -> Drive:
    """Open a drive whose recording has ended.

    Raises:
        ExportError: it has not.
        CosimError: it is no drive.
    """
    drive = Drive(path)
    demand_finished(drive)
    return drive


def demand_finished(drive: Drive) -> None:
    """Raise ExportError for a simulated drive that is not finished."""
    if drive.kind == "simulated" and not drive.info:
        raise ExportError(
            f"{drive.root}: drive.yaml is absent, so the recording is unfinished ({len(drive)} frames so far); "
            "finish it with the same cosim run, then export"
        )


def demand(drive: Drive, part: str, wanted_for: str) -> None:
    """Raise ExportError unless all frames have a part."""
    lacking = [frame.name for frame in drive if not frame.has(part)]
    if lacking:
        raise ExportError(
            f"{drive.root}: {wanted_for} needs {part}/, which {len(lacking)} of {len(drive)} frames do not have "
            f"(the first is {lacking[0]}); add it, or choose another format"
        )


def needed(module: str) -> ModuleType:
    """Import a library that only exports need.

    Raises:
        ExportError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise ExportError(f"this format needs the package {package}; install it with pip install {package}") from error


def sequences(drive: Drive) -> list[Sequence]:
    """A drive divided into its simulations; a recording is a single part."""
    entries = DriveWriter(drive.base).manifest() if (drive.base / "manifest.jsonl").is_file() else {}
    cut: list[list[str]] = []
    times: list[list[float]] = []
    last: tuple[object, float] | None = None
    for index, name in enumerate(drive.frames):
        entry = entries.get(name, {})
        episode, time_s = entry.get("episode"), float(entry.get("time_s", index * drive.sweep_s))
        if last is None or episode != last[0] or time_s <= last[1]:
            cut.append([])
            times.append([])
        cut[-1].append(name)
        times[-1].append(time_s)
        last = episode, time_s
    return [
        Sequence(number, tuple(drive[name] for name in names), np.array(time) - time[0])
        for number, (names, time) in enumerate(zip(cut, times, strict=True))
    ]


class WorldPoses:
    """Poses in the coordinates of the network's files, whatever local origin a twin has.

    Args:
        drive: whose `twin/origin.yaml` and manifest are read.
    """

    def __init__(self, drive: Drive) -> None:
        self._origins = read_origins(drive.base)
        entries = DriveWriter(drive.base).manifest() if "" not in self._origins and self._origins else {}
        self._town = {name: str(entry.get("town", "")) for name, entry in entries.items()}

    def origin_m(self, frame: Frame) -> np.ndarray:
        """(3,) float64 offset of the local origin of a frame's twin [m]."""
        return self._origins.get(self._town.get(frame.name, ""), np.zeros(3))

    def of(self, frame: Frame, pose: np.ndarray) -> np.ndarray:
        """A pose (4, 4) of a frame's twin in world coordinates."""
        moved = pose.astype(np.float64)
        moved[:3, 3] += self.origin_m(frame)
        return moved


def lidar_frames(drive: Drive, frame: Frame) -> dict[str, Frame]:
    """A frame as each of a drive's LiDARs saw it, by the LiDAR's name; a first one without a name is `top`."""
    first = frame.twin.lidar.name or "top"
    return {first: frame} | {name: drive.of_lidar(name)[frame.name] for name in drive.lidars}


def instance_boxes(twin: TwinFrame) -> Boxes:
    """Boxes of all instances of a frame in LiDAR axes, upright there, in the twin's order."""
    to_lidar = np.linalg.inv(twin.ego.pose @ twin.lidar.pose_ego)
    poses = np.array([to_lidar @ one.pose for one in twin.instances]).reshape(-1, 4, 4)
    size = np.array([(one.length_m, one.width_m, one.height_m) for one in twin.instances]).reshape(-1, 3)
    centre = poses[:, :3, 3] + poses[:, :3, 2] * size[:, 2:] / 2
    return Boxes(centre, size, np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))


def labelled_instances(frame: Frame) -> list[int]:
    """Row of the twin's instance that each label of a frame is of; −1 for `DontCare` and where there is none."""
    frame = levelled(frame)
    labels = frame.labels
    found = [-1] * len(labels)
    rows = [row for row, kind in enumerate(labels.type) if kind.lower() != "dontcare"]
    if not rows or not frame.has("twin/frames"):
        return found
    things = instance_boxes(frame.twin)
    if not len(things):
        return found
    labelled = labels[np.array(rows)].boxes_velo(frame.calibration)
    away = np.linalg.norm(labelled.centre[:, None, :2] - things.centre[None, :, :2], axis=2)
    for label, thing in zip(*linear_sum_assignment(away), strict=True):
        if away[label, thing] < _SAME_OBJECT_M:
            found[rows[int(label)]] = int(thing)
    return found


def point_instances(frame: Frame, margin_m: float = 0.1) -> np.ndarray:
    """Row of the twin's instance in whose box each point lies, (n,) int64; −1 for none."""
    frame = levelled(frame)
    found = np.full(len(frame.points), -1)
    inside = points_in_boxes(frame.points, instance_boxes(frame.twin), margin_m)
    for row in np.flatnonzero(inside.any(1)):
        found[inside[row]] = row
    return found


class ExportedTracks:
    """Integer ids, in order of appearance, from 0."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def number(self, name: str) -> int:
        """The number of an id."""
        return self._numbers.setdefault(name, len(self._numbers))

    def __len__(self) -> int:
        return len(self._numbers)

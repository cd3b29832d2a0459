"""KITTI's other layouts: tracking, odometry, and SemanticKITTI, which is odometry with a class for every point."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Drive, Frame
from cosim.drives.kitti.calibration import format_calibration
from cosim.drives.twin.frame import TwinFrame
from cosim.export.point_classes import point_classes
from cosim.export.source import ExportedTracks, Sequence, demand, labelled_instances, point_instances, sequences

_TRACKING = {"image_0": "image_00", "image_1": "image_01", "image_2": "image_02", "image_3": "image_03"}


def export_tracking(drive: Drive, folder: Path, on_frame: Callable[[], None]) -> dict[str, int]:
    """Write `training/{velodyne,image_02,calib,label_02,oxts}`, a sequence a simulation.

    Geiger et al., KITTI tracking development kit, readme.txt: a line of `label_02/0000.txt` is frame, track id and
    then the object label; `DontCare` has the track −1.
    """
    demand(drive, "label_2", "kitti-tracking")
    demand(drive, "twin/frames", "kitti-tracking")
    objects, root = 0, folder / "training"
    for sequence in sequences(drive):
        tracks, lines, records = ExportedTracks(), [], []
        for index, frame in enumerate(sequence):
            _link(frame, "velodyne", root / "velodyne" / sequence.name, index)
            for part, name in _TRACKING.items():
                _link(frame, part, root / name / sequence.name, index)
            text = [line for line in frame.path("label_2").read_text(encoding="utf-8").splitlines() if line.strip()]
            for line, row in zip(text, labelled_instances(frame), strict=True):
                track = -1 if row < 0 else tracks.number(frame.twin.instances[row].id)
                lines.append(f"{index} {track} {line}")
            if frame.has("oxts"):
                records.append(frame.path("oxts").read_text(encoding="utf-8").strip())
            on_frame()
        _write(root / "calib" / f"{sequence.name}.txt", _tracking_calibration(sequence.frames[0]))
        _write(root / "label_02" / f"{sequence.name}.txt", _lines(lines))
        _write(root / "oxts" / f"{sequence.name}.txt", _lines(records))
        objects += len(tracks)
    return {"frames": len(drive), "sequences": len(sequences(drive)), "tracks": objects}


def export_odometry(drive: Drive, folder: Path, on_frame: Callable[[], None]) -> dict[str, int]:
    """Write `sequences/00/{velodyne,image_0,…,calib.txt,times.txt}` and `poses/00.txt`: camera 0 in its first place.

    Geiger et al., KITTI odometry development kit, readme.txt.
    """
    demand(drive, "twin/frames", "kitti-odometry")
    found = sequences(drive)
    for sequence in found:
        _odometry(sequence, folder, on_frame)
    return {"frames": len(drive), "sequences": len(found)}


def export_semantic(drive: Drive, folder: Path, on_frame: Callable[[], None]) -> dict[str, int]:
    """Write the odometry layout with `labels/NAME.label`: instance << 16 | class, uint32 a point.

    Behley et al., SemanticKITTI, ICCV 2019; classes as in semantic-kitti.yaml. Instances keep their number throughout
    a sequence. Moving road users have a `moving-` class.
    """
    demand(drive, "twin/frames", "semantickitti")
    demand(drive, "hits", "semantickitti")
    found, points = sequences(drive), 0
    for sequence in found:
        root = _odometry(sequence, folder, lambda: None)
        tracks = ExportedTracks()
        for index, frame in enumerate(sequence):
            within = point_instances(frame)
            classes = point_classes(drive, frame, within).astype(np.uint32)
            numbers = np.array([tracks.number(one.id) + 1 for one in frame.twin.instances] or [0], np.uint32)
            instance = np.where(within >= 0, numbers[np.maximum(within, 0)], 0).astype(np.uint32)
            path = root / "labels" / f"{index:06d}.label"
            path.parent.mkdir(parents=True, exist_ok=True)
            (instance << np.uint32(16) | classes).astype("<u4").tofile(path)
            points += len(classes)
            on_frame()
    return {"frames": len(drive), "sequences": len(found), "points": points}


def _odometry(sequence: Sequence, folder: Path, on_frame: Callable[[], None]) -> Path:
    root = folder / "sequences" / f"{sequence.number:02d}"
    first: np.ndarray | None = None
    poses = []
    for index, frame in enumerate(sequence):
        _link(frame, "velodyne", root / "velodyne", index)
        for part in _TRACKING:
            _link(frame, part, root / part, index)
        camera = _lidar_pose(frame.twin) @ frame.calibration.rect_to_velo_matrix
        first = camera if first is None else first
        poses.append(" ".join(f"{value:.9e}" for value in (np.linalg.inv(first) @ camera)[:3].reshape(-1)))
        on_frame()
    _write(root / "calib.txt", _odometry_calibration(sequence.frames[0]))
    _write(root / "times.txt", _lines([f"{time:.6e}" for time in sequence.time_s]))
    _write(folder / "poses" / f"{sequence.number:02d}.txt", _lines(poses))
    _write(root / "poses.txt", _lines(poses))
    return root


def _odometry_calibration(frame: Frame) -> str:
    """P0 to P3 and Tr, LiDAR to rectified camera 0; cameras that are not known are those of the second."""
    calibration = frame.calibration
    rows = {}
    for camera in range(4):
        rows[f"P{camera}"] = calibration.projection(camera if camera in calibration.cameras else 2)
    rows["Tr"] = calibration.velo_to_rect_matrix[:3]
    return _lines([f"{name}: " + " ".join(f"{v:.12e}" for v in matrix.reshape(-1)) for name, matrix in rows.items()])


def _tracking_calibration(frame: Frame) -> str:
    """The object layout's text with the keys of the tracking benchmark."""
    text = format_calibration(frame.calibration)
    for ours, theirs in (
        ("R0_rect:", "R_rect"),
        ("Tr_velo_to_cam:", "Tr_velo_cam"),
        ("Tr_imu_to_velo:", "Tr_imu_velo"),
    ):
        text = text.replace(ours, theirs)
    return text


def _lidar_pose(twin: TwinFrame) -> np.ndarray:
    return twin.ego.pose @ twin.lidar.pose_ego


def _link(frame: Frame, part: str, folder: Path, index: int) -> None:
    """Link a file, or copy it where the file system does not link."""
    source = frame.find(part)
    if source is None:
        return
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{index:06d}{source.suffix}"
    target.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        os.link(source, target)
    if not target.exists():
        shutil.copyfile(source, target)


def _lines(rows: list[str]) -> str:
    return "".join(f"{row}\n" for row in rows)


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")

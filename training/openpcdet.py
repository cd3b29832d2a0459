"""Export a drive in the layout of OpenPCDet's KITTI dataset class: folders, ImageSets and info files.

The info files contain one dictionary of numpy arrays per frame, as written by OpenPCDet's own preparation; boxes are
in LiDAR axes. Scans, images, labels and calibrations are hard links if the file system supports them.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cosim.drives.kitti import Drive, Frame, Labels, points_in_boxes
from cosim.drives.writer import explained
from training.data.frame import image_size, in_view
from training.data.object_bank import as_boxes
from training.errors import TrainingError
from training.evaluation.rules import MAX_OCCLUSION, MAX_TRUNCATION, MIN_HEIGHT_PX

_SPLITS = ("train", "val")
_PARTS = ("velodyne", "calib", "label_2", "image_2")


def export_openpcdet(
    drive: Drive, folder: Path, *, held_out: float = 0.5, on_frame: Callable[[], None] = lambda: None
) -> dict[str, int]:
    """Write `folder` so that it can be OpenPCDet's `data/kitti`; returns frames by split.

    Args:
        drive: labelled frames, simulated or real. Its own lists train and val are kept; without them the last
            `held_out` of the frames are val.
        folder: output folder.
        held_out: share of validation frames, 0–1.
        on_frame: called after every frame.

    Raises:
        TrainingError: a frame without labels.
        OutputError: the folder cannot be written.
    """
    splits = _splits(drive, held_out)
    infos = {}
    with explained(folder):
        for part in _PARTS:
            (folder / "training" / part).mkdir(parents=True, exist_ok=True)
        for split, names in splits.items():
            infos[split] = []
            for name in names:
                frame = drive[name]
                if not frame.has("label_2"):
                    raise TrainingError(f"{drive.root}: frame {name} has no label_2/; export labelled frames only")
                _link_parts(frame, folder / "training")
                infos[split].append(frame_info(frame))
                on_frame()
        _write(folder, splits, infos)
    return {split: len(names) for split, names in splits.items()}


def frame_info(frame: Frame) -> dict[str, Any]:
    """Info dictionary of a frame."""
    width, height = image_size(frame)
    calibration = frame.calibration
    square = {name: np.eye(4) for name in ("P2", "R0_rect", "Tr_velo_to_cam")}
    square["P2"][:3] = calibration.P2
    square["R0_rect"][:3, :3] = calibration.R0_rect
    square["Tr_velo_to_cam"][:3] = calibration.Tr_velo_to_cam
    return {
        "point_cloud": {"num_features": 4, "lidar_idx": frame.name},
        "image": {"image_idx": frame.name, "image_shape": np.array([height, width], np.int32)},
        "calib": {name: matrix.astype(np.float32) for name, matrix in square.items()},
        "annos": annotations_of(frame),
    }


def annotations_of(frame: Frame) -> dict[str, np.ndarray]:
    """The labels of a frame: objects first, then DontCare regions; boxes and point counts of the objects only."""
    cared = frame.labels.cared_for
    labels = cared.followed_by(frame.labels.of_type("DontCare"))
    boxes = cared.boxes_velo(frame.calibration)
    table = np.column_stack([boxes.centre, boxes.size, boxes.yaw]).reshape(-1, 7)
    seen = frame.points[in_view(frame, frame.points)]
    counts = np.full(len(labels), -1, np.int32)
    counts[: len(cared)] = points_in_boxes(seen, boxes).sum(1)
    return {
        "name": np.array(labels.type),
        "truncated": labels.truncated,
        "occluded": labels.occluded.astype(np.float64),
        "alpha": labels.alpha,
        "bbox": labels.bbox.astype(np.float32),
        "dimensions": labels.dimensions[:, [2, 0, 1]],  # length, height, width
        "location": labels.location.astype(np.float32),
        "rotation_y": labels.rotation_y,
        "score": np.full(len(labels), -1.0),
        "difficulty": _difficulty(labels),
        "index": np.array([*range(len(cared)), *([-1] * (len(labels) - len(cared)))], np.int32),
        "gt_boxes_lidar": table,
        "num_points_in_gt": counts,
    }


def object_database(infos: list[dict[str, Any]], drive: Drive, folder: Path) -> dict[str, list[dict[str, Any]]]:
    """Write the objects of the training frames for ground-truth sampling; returns their entries by class."""
    database: dict[str, list[dict[str, Any]]] = {}
    (folder / "gt_database").mkdir(exist_ok=True)
    for info in infos:
        name, annos = info["point_cloud"]["lidar_idx"], info["annos"]
        points = drive[name].points
        inside = points_in_boxes(points, as_boxes(annos["gt_boxes_lidar"]))
        for row, mask in enumerate(inside):
            kind, box = str(annos["name"][row]), annos["gt_boxes_lidar"][row]
            path = Path("gt_database") / f"{name}_{kind}_{row}.bin"
            cut = points[mask].copy()
            cut[:, :3] -= box[:3].astype(np.float32)
            (folder / path).write_bytes(cut.tobytes())
            entry = {"name": kind, "path": str(path), "image_idx": name, "gt_idx": row, "box3d_lidar": box}
            entry |= {"num_points_in_gt": int(mask.sum()), "difficulty": annos["difficulty"][row]}
            entry |= {"bbox": annos["bbox"][row], "score": annos["score"][row]}
            database.setdefault(kind, []).append(entry)
    return database


def _write(folder: Path, splits: dict[str, tuple[str, ...]], infos: dict[str, list[dict[str, Any]]]) -> None:
    (folder / "ImageSets").mkdir(exist_ok=True)
    for split, names in {**splits, "trainval": (*splits["train"], *splits["val"]), "test": ()}.items():
        (folder / "ImageSets" / f"{split}.txt").write_text("".join(f"{name}\n" for name in names), encoding="utf-8")
    database = object_database(infos["train"], Drive(folder), folder)
    contents = {
        "kitti_infos_train": infos["train"],
        "kitti_infos_val": infos["val"],
        "kitti_infos_trainval": infos["train"] + infos["val"],
        "kitti_infos_test": [],
        "kitti_dbinfos_train": database,
    }
    for name, content in contents.items():
        (folder / f"{name}.pkl").write_bytes(pickle.dumps(content, protocol=4))


def _difficulty(labels: Labels) -> np.ndarray:
    """Easiest matching difficulty with OpenPCDet's limits: 0 easy, 1 moderate, 2 hard, −1 none."""
    height = labels.bbox[:, 3] - labels.bbox[:, 1] + 1
    level = np.full(len(labels), -1, np.int32)
    for number in (2, 1, 0):
        fits = (height >= MIN_HEIGHT_PX[number]) & (labels.occluded <= MAX_OCCLUSION[number])
        level[fits & (labels.truncated <= MAX_TRUNCATION[number])] = number
    return level


def _splits(drive: Drive, held_out: float) -> dict[str, tuple[str, ...]]:
    if all(split in drive.splits for split in _SPLITS):
        return {split: drive.split(split) for split in _SPLITS}
    cut = len(drive.frames) - round(len(drive.frames) * held_out)
    return {"train": drive.frames[:cut], "val": drive.frames[cut:]}


def _link_parts(frame: Frame, folder: Path) -> None:
    for part in _PARTS:
        source = frame.find(part)
        if source is None:
            continue
        target = folder / part / source.name
        if target.exists():
            continue
        with contextlib.suppress(OSError):
            os.link(source, target)
        if not target.exists():
            shutil.copyfile(source, target)

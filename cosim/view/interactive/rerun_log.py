"""Frames as Rerun shows them: points, boxes, images and transforms, on one time line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from scipy.linalg import rq

from cosim.drives.kitti import Boxes, Drive, Frame
from cosim.drives.kitti.level import levelled
from cosim.drives.writer import explained
from cosim.errors import CosimError
from cosim.view.camera_images import KITTI_CAMERAS, camera_parts, straight_image
from cosim.view.colours import Scale, class_colour
from cosim.view.frame_pictures import intensity_scale
from cosim.view.interactive.drives import ShownDrives
from cosim.view.objects import find_objects, labelled_boxes
from cosim.view.titles import drive_title

_APPLICATION = "cosim view"
_TIMELINE = "step"
_POINT_RADIUS_M = 0.03


class RerunError(CosimError):
    """Rerun cannot be used."""


def log_to_rerun(shown: ShownDrives, file: Path | None, on_frame: Callable[[str], None] = lambda name: None) -> None:
    """Log frames to Rerun; each drive has its own tree `world/ego/lidar`.

    Args:
        shown: drives to log.
        file: `.rrd` file to write; None opens the viewer.
        on_frame: called with the name of every frame before it is logged.

    Raises:
        RerunError: rerun-sdk is not installed, or its viewer does not open.
        CosimError: a part of a frame is damaged.
    """
    rr = _rerun()
    rr.init(_APPLICATION)
    if file is None:
        try:
            rr.spawn()
        except (RuntimeError, OSError) as error:
            raise RerunError(f"Rerun's viewer does not open ({error}); --out FILE.rrd saves instead") from None
    else:
        with explained(file):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.open("ab").close()
        rr.save(str(file))
    drives = [records.drive for records in shown.records]
    roots = [f"drive_{row}" if len(drives) > 1 else "world" for row in range(len(drives))]
    scale = intensity_scale(drives[0], tuple(step[0] for step in shown.steps[:6]))
    for root, drive in zip(roots, drives, strict=True):
        rr.log(root, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        rr.log(f"{root}/title", rr.TextDocument(drive_title(drive)), static=True)
    for number, step in enumerate(shown.steps):
        on_frame(step[0])
        rr.set_time(_TIMELINE, sequence=number)
        for root, drive, name in zip(roots, drives, step, strict=True):
            _log_frame(rr, root, drive, levelled(drive[name]), scale)
    rr.disconnect()


def _rerun() -> ModuleType:
    try:
        import rerun  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise RerunError("--rerun needs rerun-sdk, which is not installed; run: pip install 'cosim[rerun]'") from None
    return rerun


def _log_frame(rr: Any, root: str, drive: Drive, frame: Frame, scale: Scale) -> None:
    ego, lidar = f"{root}/ego", f"{root}/ego/lidar"
    if frame.has("twin/frames"):
        rr.log(ego, _transform(rr, frame.twin.ego.pose))
        rr.log(lidar, _transform(rr, frame.twin.lidar.pose_ego))
    points = frame.points
    rr.log(
        f"{lidar}/points",
        rr.Points3D(points[:, :3], colors=scale.colours(points[:, 3]), radii=_POINT_RADIUS_M),
    )
    types = frame.labels.cared_for.type if frame.has("label_2") else ()
    _log_boxes(rr, f"{lidar}/labels", labelled_boxes(frame), types)
    objects = find_objects(frame)
    if objects.source == "twin":
        _log_boxes(rr, f"{lidar}/objects", objects.boxes, objects.kinds)
    shown = camera_parts(frame)
    for part in shown:
        _log_camera(rr, f"{lidar}/{part}", frame, part)
    for part in KITTI_CAMERAS:
        if part not in shown and (drive.root / part).is_dir():
            rr.log(f"{lidar}/{part}", rr.Clear(recursive=False))  # or the last frame's would stay


def _log_boxes(rr: Any, path: str, boxes: Boxes, types: tuple[str, ...]) -> None:
    turn = np.stack([0 * boxes.yaw, 0 * boxes.yaw, np.sin(boxes.yaw / 2), np.cos(boxes.yaw / 2)], -1)
    rr.log(
        path,
        rr.Boxes3D(
            centers=boxes.centre,
            half_sizes=boxes.size / 2,
            quaternions=turn,
            labels=list(types),
            colors=np.array([class_colour(kind) for kind in types], np.uint8).reshape(-1, 3),
        ),
    )


def _log_camera(rr: Any, path: str, frame: Frame, part: str) -> None:
    """The image, and where it was taken: K·[R | t] carries LiDAR axes into pixels."""
    image = straight_image(frame, part)
    to_pixels = frame.calibration.to_pixels(part.removeprefix("image_"))
    matrix, rotation = rq(to_pixels[:, :3])
    signs = np.sign(np.diag(matrix))
    matrix, rotation = matrix * signs, rotation * signs[:, None]
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation.T, -np.linalg.solve(to_pixels[:, :3], to_pixels[:, 3])
    height, width = image.shape[:2]
    rr.log(path, _transform(rr, pose))
    rr.log(path, rr.Pinhole(image_from_camera=matrix, width=width, height=height, camera_xyz=rr.ViewCoordinates.RDF))
    rr.log(path, rr.Image(image).compress(jpeg_quality=90))


def _transform(rr: Any, pose: np.ndarray) -> Any:
    return rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3])

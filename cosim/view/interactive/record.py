"""Records of frames for the interactive page, as bytes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np

from cosim.drives.kitti import Boxes, Drive, Frame
from cosim.drives.kitti.level import levelled
from cosim.errors import CosimError
from cosim.view.camera_images import camera_parts, straight_image
from cosim.view.facts import Facts
from cosim.view.interactive.columns import point_columns, residual_column
from cosim.view.interactive.packing import PackedColumn, pack
from cosim.view.interactive.residual import PointResiduals, ResidualTracer
from cosim.view.objects import Objects, PointInstances, find_objects, labelled_boxes
from sensors.errors import SensorError

_JPEG_QUALITY = 88
_SENSOR_HEIGHT_M = 1.73  # height of KITTI's LiDAR, for drives without a sensor height
_MAX_CLASSES = 4


class FrameRecords:
    """Makes the records of a drive's frames.

    Args:
        drive: drive.
        residuals: tracer of the twin; None if there is no twin.
        why_not: reason why there is no tracer.
        most_cameras: maximum number of images per frame, the left colour image first.
        thorough: use strong instead of fast compression.
    """

    def __init__(
        self, drive: Drive, residuals: ResidualTracer | None, why_not: str, *, most_cameras: int, thorough: bool
    ) -> None:
        self.drive = drive
        self._residuals, self._why_not = residuals, why_not
        self._most_cameras, self._thorough = most_cameras, thorough

    @property
    def traces(self) -> bool:
        """Whether there is a twin to trace."""
        return self._residuals is not None

    def whole(self, name: str) -> bytes:
        """Complete record of a frame; see `packing`.

        Raises:
            CosimError: the frame does not exist, or its points or another required part are damaged.
        """
        return self._record(levelled(self.drive[name]), *self._traced(name), deferred=())

    def quick(self, name: str) -> bytes:
        """Record without the columns that require tracing the twin, which `extra` provides."""
        frame = levelled(self.drive[name])
        return self._record(frame, None, self._why_not, () if self._residuals is None else _traced_modes(frame))

    def extra(self, name: str) -> bytes:
        """The columns that are missing in the record of `quick`."""
        modes = _traced_modes(self.drive[name])
        residuals, why_not = self._traced(name)
        if residuals is None:
            return pack({"absent": dict.fromkeys(modes, why_not), "materials": []}, [], {})
        columns = [residual_column(residuals)]
        if "material" in modes:
            columns.append(PackedColumn("material", residuals.material))
        materials = _readable(residuals.materials) if "material" in modes else []
        return pack({"absent": {}, "materials": materials}, columns, {}, thorough=self._thorough)

    def _record(self, frame: Frame, residuals: PointResiduals | None, why_not: str, deferred: tuple[str, ...]) -> bytes:
        objects = find_objects(frame)
        found = point_columns(self.drive, frame, objects, residuals, why_not)
        parts = camera_parts(frame)[: self._most_cameras]
        images = {part: _jpeg(straight_image(frame, part)) for part in parts}
        header = {
            "name": frame.name,
            "facts": _facts(frame, moves=self.drive.info.get("twin") != "labels"),
            "boxes": [*_labels(frame), *_objects(objects, found.met, frame)],
            "cameras": [_camera(frame, part) for part in images],
            "absent": {mode: why for mode, why in found.absent.items() if mode not in deferred},
            "deferred": deferred,
            "materials": _readable(found.materials),
            "ground_m": -_sensor_height(frame),
        }
        return pack(header, found.columns, images, thorough=self._thorough)

    def _traced(self, name: str) -> tuple[PointResiduals | None, str]:
        if self._residuals is None:
            return None, self._why_not
        try:
            return self._residuals.trace(name), ""
        except (CosimError, SensorError) as error:
            return None, str(error)


def _traced_modes(frame: Frame) -> tuple[str, ...]:
    """Colour modes that require tracing the twin."""
    return ("residual",) if frame.has("hits") else ("residual", "material")


def _jpeg(image: np.ndarray) -> bytes:
    pixels = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()


def _camera(frame: Frame, part: str) -> dict[str, Any]:
    """Projection of homogeneous LiDAR coordinates to (u·d, v·d, d), row by row."""
    matrix = frame.calibration.to_pixels(part.removeprefix("image_"))
    return {"name": part, "matrix": [float(f"{value:.9g}") for value in matrix.ravel()]}


def _facts(frame: Frame, *, moves: bool) -> Facts:
    """Time and ego speed (not for twins from labels), points and labels."""
    facts: Facts = []
    if frame.has("twin/frames") and moves:
        twin = frame.twin
        facts.append(("time", f"{twin.time_s:.1f} s"))
        facts.append(("ego", f"{3.6 * np.linalg.norm(twin.ego.velocity_mps):.0f} km/h"))
    elif frame.has("oxts"):
        speed = np.hypot(frame.oxts.vf, frame.oxts.vl)
        facts.append(("ego", f"{3.6 * speed:.0f} km/h"))
    facts.append(("points", f"{len(frame.points):,}"))
    if frame.has("label_2"):
        classes = Counter(frame.labels.cared_for.type).most_common()
        counts = [f"{count} {name}" for name, count in classes[:_MAX_CLASSES]]
        rest = sum(count for _, count in classes[_MAX_CLASSES:])
        facts.append(("labels", ", ".join([*counts, f"{rest} others"] if rest else counts) or "none"))
    return facts


def _labels(frame: Frame) -> Iterator[dict[str, Any]]:
    if not frame.has("label_2"):
        return
    labels, boxes = frame.labels.cared_for, labelled_boxes(frame)
    truncation = labels.truncation
    occlusion = {0: "visible", 1: "partly occluded", 2: "largely occluded"}
    for row, kind in enumerate(labels.type):
        note = occlusion.get(int(labels.occluded[row]), "")
        if truncation[row] >= 0.005:
            note += f"{', ' if note else ''}{truncation[row]:.0%} cut off"
        yield _box(boxes, row, kind, "label", note)


def _objects(objects: Objects, met: PointInstances, frame: Frame) -> Iterator[dict[str, Any]]:
    """Those of the twin, with how many points they have and how fast they are."""
    if objects.source != "twin":
        return
    counts = np.bincount(met.number + 1, minlength=len(objects) + 1)[1:]
    for row, thing in enumerate(frame.twin.instances):
        speed = 3.6 * np.linalg.norm(thing.velocity_mps)
        yield _box(objects.boxes, row, thing.kind, "object", f"{thing.id}, {counts[row]} points, {speed:.0f} km/h")


def _box(boxes: Boxes, row: int, kind: str, source: str, note: str) -> dict[str, Any]:
    return {
        "kind": kind,
        "source": source,
        "note": note,
        "centre": np.round(boxes.centre[row], 3).tolist(),
        "size": np.round(boxes.size[row], 3).tolist(),
        "yaw": round(float(boxes.yaw[row]), 4),
    }


def _readable(names: tuple[str, ...]) -> list[str]:
    return [name.replace("_", " ") for name in names]


def _sensor_height(frame: Frame) -> float:
    """Height of the LiDAR above the ground [m]."""
    return float(frame.twin.lidar.pose_ego[2, 3]) if frame.has("twin/frames") else _SENSOR_HEIGHT_M

"""Objects of a frame: their boxes, and the object of every point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cosim.drives.kitti import Boxes, Drive, Frame, points_in_boxes
from cosim.drives.twin import TwinFrame
from cosim.errors import FormatError
from sensors.hits import NOTHING, Hits
from sensors.hits_file import load_hits
from sensors.pattern import Pattern, load_pattern

STATIC = -1
NO_MATERIAL = 255
_BOX_MARGIN_M = 0.1
ON_SURFACE_M = 1.0  # a point farther from the hit of its beam is not on that surface


@dataclass(frozen=True, eq=False)
class Objects:
    """Objects of a frame; with a twin also those without a label.

    Attributes:
        boxes: n boxes in LiDAR axes.
        kinds: n classes or kinds.
        source: origin of the objects.
    """

    boxes: Boxes
    kinds: tuple[str, ...]
    source: Literal["twin", "labels", "none"]

    def __len__(self) -> int:
        return len(self.kinds)


@dataclass(frozen=True, eq=False)
class PointInstances:
    """Object of every point.

    Attributes:
        number: (n,) int64 index in `Objects`, −1 for the static world.
        source: `hits` if from traced hits, `boxes` if points were assigned to boxes, `none` without objects.
        material: (n,) uint8 index in `materials`, `NO_MATERIAL` if the point is not on the surface that its beam hit;
            None without traced hits.
        materials: names of materials.
    """

    number: np.ndarray
    source: Literal["hits", "boxes", "none"]
    material: np.ndarray | None = None
    materials: tuple[str, ...] = ()


def labelled_boxes(frame: Frame) -> Boxes:
    """Labelled boxes in LiDAR axes without `DontCare` regions; empty without labels."""
    if not frame.has("label_2"):
        return Boxes(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    return frame.labels.cared_for.boxes_velo(frame.calibration)


def find_objects(frame: Frame) -> Objects:
    """Find the objects of a frame: those of the twin, else of the labels, else none."""
    if frame.has("twin/frames"):
        twin = frame.twin
        instances = twin.instances
        return Objects(
            _twin_boxes(twin),
            tuple(instance.kind for instance in instances),
            "twin",
        )
    boxes = labelled_boxes(frame)
    types = frame.labels.cared_for.type if frame.has("label_2") else ()
    return Objects(boxes, types, "labels" if frame.has("label_2") else "none")


def find_instances(drive: Drive, frame: Frame, objects: Objects) -> PointInstances:
    """Find the object of every point, from stored hits if they exist, else from the boxes.

    Raises:
        SensorError: the stored hits or the pattern are damaged.
        FormatError: hits and twin do not match.
    """
    if frame.has("hits") and frame.has("rays") and objects.source == "twin" and drive.pattern is not None:
        pattern = load_pattern(drive.pattern)
        hits = load_hits(frame.hits_path, pattern.rays())
        if len(hits.paint) != len(objects):
            raise FormatError(
                f"{frame.hits_path}: hits of {len(hits.paint)} instances but the twin has {len(objects)}; "
                "they are from different runs: record the frame again"
            )
        return _of_hits(frame, hits, pattern)
    if not len(objects):
        return PointInstances(np.full(len(frame.points), STATIC), "none")
    inside = points_in_boxes(frame.points, _above_ground(objects.boxes), _BOX_MARGIN_M)
    return PointInstances(np.where(inside.any(0), inside.argmax(0), STATIC), "boxes")


def _above_ground(boxes: Boxes) -> Boxes:
    """Raise the bottom of the boxes, so that the road is outside of the boxes with margin."""
    raised = [0, 0, _BOX_MARGIN_M]
    return Boxes(boxes.centre + raised, np.maximum(boxes.size - raised, _BOX_MARGIN_M), boxes.yaw)


def _twin_boxes(twin: TwinFrame) -> Boxes:
    """Boxes of the instances in LiDAR axes; pitch and roll, which are small, are ignored."""
    lidar_from_world = np.linalg.inv(twin.ego.pose @ twin.lidar.pose_ego)
    sizes = np.array([[box.length_m, box.width_m, box.height_m] for box in twin.instances]).reshape(-1, 3)
    poses = np.array([lidar_from_world @ box.pose for box in twin.instances]).reshape(-1, 4, 4)
    centre = poses[:, :3, 3] + poses[:, :3, 2] * sizes[:, 2:] / 2
    return Boxes(centre, sizes, np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))


def _of_hits(frame: Frame, hits: Hits, pattern: Pattern) -> PointInstances:
    """Object and material of the hit of each point's beam; static and without material if the point is not on it."""
    rays = frame.rays
    offset = np.radians(np.array(pattern.azimuth_offset_deg))[rays.ring]
    column = np.mod(np.pi - (rays.azimuth.astype(np.float64) - offset), 2 * np.pi)
    firing = np.clip(np.rint(column / (2 * np.pi) * pattern.firings - 0.5).astype(int), 0, pattern.firings - 1)
    met = hits.solid.take(rays.ring.astype(int) * pattern.firings + firing)
    distance = np.linalg.norm(frame.points[:, :3], axis=1)
    with np.errstate(invalid="ignore"):
        on_it = np.abs(distance - met.range_m) < ON_SURFACE_M
    number = np.where(on_it & (met.instance != NOTHING), met.instance, STATIC).astype(np.int64)
    return PointInstances(number, "hits", np.where(on_it, met.material, NO_MATERIAL), tuple(hits.table.names))

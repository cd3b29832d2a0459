"""Match labelled boxes with the vehicles of the twin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.drives.kitti import Drive
from cosim.drives.kitti.frame import Frame
from cosim.drives.twin.frame import Instance, TwinFrame
from sensors.label_boxes import LabelBoxes

LIFT_M = 0.04
_KINDS = {"Car": ("car",), "Van": ("van", "car"), "Truck": ("truck", "bus", "van"), "Misc": ("truck", "van", "car")}
_MAX_DISTANCE_M = 1.5
_MIN_POINTS = 12


@dataclass(frozen=True, eq=False)
class LabelRows:
    """n labels matched with vehicles of the twin.

    Attributes:
        track: (n,) int, number of the vehicle; the labels of a vehicle in all frames have the same number.
        loss_m: (n, 3) length, width and height of the vehicle minus those of the label [m].
        gap_m: (n, 3) length, width and height of the vehicle minus the extent of its points above the road [m].
        below: (n,) share of the gap in height that is below the points.
        raised_m: (n,) height of the label's lower edge above that of the vehicle [m].
    """

    track: np.ndarray
    loss_m: np.ndarray
    gap_m: np.ndarray
    below: np.ndarray
    raised_m: np.ndarray

    def __len__(self) -> int:
        return len(self.track)

    @property
    def tracks(self) -> int:
        """Number of vehicles."""
        return len(np.unique(self.track))


def gather(drive: Drive) -> LabelRows:
    """Match all labelled vehicles of a drive that are in the twin and have enough points."""
    numbers: dict[str, int] = {}
    rows: list[tuple] = []
    for name in drive.frames:
        frame = drive[name]
        if frame.has("label_2") and frame.has("twin/frames"):
            rows += [(numbers.setdefault(name, len(numbers)), *values) for name, *values in _match_frame(frame)]
    if not rows:
        return LabelRows(np.zeros(0, int), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    track, loss, gap, below, raised = zip(*rows, strict=True)
    return LabelRows(np.array(track), np.array(loss), np.array(gap), np.array(below), np.array(raised))


def _match_frame(frame: Frame) -> list[tuple[str, np.ndarray, np.ndarray, float, float]]:
    labels = frame.labels.cared_for
    boxes, twin = labels.boxes_velo(frame.calibration), frame.twin
    vehicles = [instance for instance in twin.instances if any(instance.kind in types for types in _KINDS.values())]
    if not vehicles or not len(labels):
        return []
    exact = _boxes_in_lidar_axes(twin, vehicles, frame.points[:, :3])
    matches = []
    for row, kind in enumerate(labels.type):
        distance = np.hypot(*(exact.centre[:, :2] - boxes.centre[row, :2]).T)
        distance[[vehicle.kind not in _KINDS.get(kind, ()) for vehicle in vehicles]] = np.inf
        nearest = int(np.argmin(distance))
        if not distance[nearest] < _MAX_DISTANCE_M:
            continue
        points = exact.local_points(nearest, LIFT_M)
        if len(points) < _MIN_POINTS:
            continue
        low, high = points.min(0), points.max(0)
        gap = exact.size[nearest] - (high - low)
        below = (low[2] + exact.size[nearest, 2] / 2) / max(gap[2], 1e-6)
        floor = boxes.centre[row, 2] - boxes.size[row, 2] / 2
        raised = floor - (exact.centre[nearest, 2] - exact.size[nearest, 2] / 2)
        loss = exact.size[nearest] - boxes.size[row]
        matches.append((vehicles[nearest].id, loss, gap, float(np.clip(below, 0, 1)), raised))
    return matches


def _boxes_in_lidar_axes(twin: TwinFrame, vehicles: list[Instance], points: np.ndarray) -> LabelBoxes:
    to_lidar = np.linalg.inv(twin.ego.pose @ twin.lidar.pose_ego)
    poses = [to_lidar @ vehicle.pose for vehicle in vehicles]
    size = np.array([[vehicle.length_m, vehicle.width_m, vehicle.height_m] for vehicle in vehicles])
    up = [pose[:3, 2] * height / 2 for pose, height in zip(poses, size[:, 2], strict=True)]
    return LabelBoxes(
        kinds=tuple(vehicle.kind for vehicle in vehicles),
        centre=np.array([pose[:3, 3] + lift for pose, lift in zip(poses, up, strict=True)]),
        size=size,
        yaw=np.array([np.arctan2(pose[1, 0], pose[0, 0]) for pose in poses]),
        kept=np.ones(len(vehicles), bool),
        points=points,
    )

"""Labelled boxes beside the bodies of the twin that they belong to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.drives.kitti import Drive
from cosim.drives.kitti.frame import Frame
from cosim.drives.twin.frame import Instance, TwinFrame
from sensors.label_boxes import LabelBoxes

LIFT_M = 0.04
_KINDS = {"Car": ("car",), "Van": ("van", "car"), "Truck": ("truck", "bus", "van"), "Misc": ("truck", "van", "car")}
_NEAR_M = 1.5
_FEWEST_POINTS = 12


@dataclass(frozen=True, eq=False)
class LabelRows:
    """Labels with their bodies, n of them.

    Attributes:
        track: (n,) int, one an object; its labels in all frames share whatever annotators did with it.
        loss_m: (n, 3) length, width and height of the body less those of the label.
        gap_m: (n, 3) the body's edge less the extent of the points in it, lifted a little off the road.
        below: (n,) share of the gap in height that is below the points.
        raised_m: (n,) how much higher the label begins than the body.
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
        """How many objects."""
        return len(np.unique(self.track))


def gather(drive: Drive) -> LabelRows:
    """Every labelled vehicle of a drive that has a body in the twin and enough points on it."""
    names: dict[str, int] = {}
    rows: list[tuple] = []
    for name in drive.frames:
        frame = drive[name]
        if frame.has("label_2") and frame.has("twin/frames"):
            rows += [(names.setdefault(who, len(names)), *values) for who, *values in _of_frame(frame)]
    if not rows:
        return LabelRows(np.zeros(0, int), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    track, loss, gap, below, raised = zip(*rows, strict=True)
    return LabelRows(np.array(track), np.array(loss), np.array(gap), np.array(below), np.array(raised))


def _of_frame(frame: Frame) -> list[tuple[str, np.ndarray, np.ndarray, float, float]]:
    labels = frame.labels.cared_for
    boxes, twin = labels.boxes_velo(frame.calibration), frame.twin
    bodies = [one for one in twin.instances if any(one.kind in kinds for kinds in _KINDS.values())]
    if not bodies or not len(labels):
        return []
    exact = _in_lidar_axes(twin, bodies, frame.points[:, :3])
    found = []
    for row, kind in enumerate(labels.type):
        apart = np.hypot(*(exact.centre[:, :2] - boxes.centre[row, :2]).T)
        apart[[one.kind not in _KINDS.get(kind, ()) for one in bodies]] = np.inf
        body = int(np.argmin(apart))
        if not apart[body] < _NEAR_M:
            continue
        points = exact.local_points(body, LIFT_M)
        if len(points) < _FEWEST_POINTS:
            continue
        low, high = points.min(0), points.max(0)
        gap = exact.size[body] - (high - low)
        below = (low[2] + exact.size[body, 2] / 2) / max(gap[2], 1e-6)
        floor = boxes.centre[row, 2] - boxes.size[row, 2] / 2
        raised = floor - (exact.centre[body, 2] - exact.size[body, 2] / 2)
        found.append((bodies[body].id, exact.size[body] - boxes.size[row], gap, float(np.clip(below, 0, 1)), raised))
    return found


def _in_lidar_axes(twin: TwinFrame, bodies: list[Instance], points: np.ndarray) -> LabelBoxes:
    to_lidar = np.linalg.inv(twin.ego.pose @ twin.lidar.pose_ego)
    poses = [to_lidar @ one.pose for one in bodies]
    size = np.array([[one.length_m, one.width_m, one.height_m] for one in bodies])
    up = [pose[:3, 2] * height / 2 for pose, height in zip(poses, size[:, 2], strict=True)]
    return LabelBoxes(
        kinds=tuple(one.kind for one in bodies),
        centre=np.array([pose[:3, 3] + lift for pose, lift in zip(poses, up, strict=True)]),
        size=size,
        yaw=np.array([np.arctan2(pose[1, 0], pose[0, 0]) for pose in poses]),
        kept=np.ones(len(bodies), bool),
        points=points,
    )

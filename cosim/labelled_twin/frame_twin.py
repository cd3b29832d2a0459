"""The twin of one measured frame, from its points and labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from assets.mesh import Mesh
from cosim.drives.kitti import Calibration, Frame, Labels, points_in_boxes
from cosim.drives.twin import Ego, Instance, Lidar, TwinCamera, TwinFrame
from cosim.drives.twin.trust import MARGIN_M, Trust, in_box
from cosim.errors import FormatError
from cosim.labelled_twin.ground_surface import REACH_M, fit_ground
from cosim.labelled_twin.objects import label_instances
from cosim.labelled_twin.road_cells import find_road_cells
from cosim.labelled_twin.scatter import body_scatter
from cosim.labelled_twin.trusted_ground import ground_mesh, trust_ground
from sensors.cameras.kitti_rig import HEIGHT_PX, WIDTH_PX, lidar_pose_ego
from sensors.pattern import Pattern

_CELL_REACH_M = REACH_M + 5.0
_MIN_POINTS = 30  # for an estimate of an object's paint
_DEFAULT_SPREAD = 0.2  # standard deviation of the intensity for objects with fewer points


@dataclass(frozen=True, eq=False)
class FrameTwin:
    """Twin of one frame.

    Attributes:
        frame: poses; the world axes are those of the ego vehicle.
        ground: mesh of the fitted ground in world axes; empty if no ground was found.
        trust: region in which the twin is reliable.
        points: number of points in the scan.
        points_trusted: number of points that are on trusted surfaces of the twin.
        ground_sd_m: robust standard deviation of the ground's points about the fitted surface; NaN without ground.
        objects_without_model: number of labelled objects of classes that have no model.
        ground_brightness: mean intensity of trusted ground; with zero points if there are no intensities.
    """

    frame: TwinFrame
    ground: Mesh
    trust: Trust
    points: int
    points_trusted: int
    ground_sd_m: float
    objects_without_model: int
    ground_brightness: Brightness


def make_frame_twin(frame: Frame, pattern: Pattern) -> FrameTwin:
    """Fit the ground, pose the models and determine the trusted regions.

    Raises:
        CosimError: points, labels or calibration are missing or damaged.
    """
    points, calibration, labels = frame.points, frame.calibration, frame.labels.cared_for
    world_from_lidar = lidar_pose_ego()
    sensor_m = world_from_lidar[:3, 3]
    on_objects = _in_labelled_boxes(points, labels, calibration)
    fit = fit_ground(find_road_cells(points, frame.rays.ring, on_objects, _CELL_REACH_M))
    trust, ground, spread = Trust.nothing(), Mesh.empty(), float("nan")
    if fit is not None:
        surface, cells = fit
        trust = trust_ground(cells, surface, points[~on_objects], sensor_m)
        if trust.ground.any():
            ground = ground_mesh(trust, surface, sensor_m)
            residual = cells.xyz[:, 2] - surface.fitted(cells.xyz[:, :2])
            spread = 1.4826 * float(np.median(np.abs(residual)))
    instances, without = label_instances(labels, calibration, world_from_lidar, frame.label_axes)
    xyz, brightness = points[:, :3].astype(np.float64) + sensor_m, Brightness(0.0, 0)
    body_sd, paint_sd = body_scatter(instances, xyz), np.zeros(len(instances))
    if frame.has_intensity:
        brightness = ground_brightness(trust, xyz, points[:, 3])
        instances, paint_sd = _estimate_paint(instances, xyz, points[:, 3])
    trust = replace(
        trust,
        ground_intensity_sd=brightness.spread,
        body_sd_m=body_sd.astype(np.float32),
        body_intensity_sd=paint_sd.astype(np.float32),
    )
    twin = TwinFrame(
        frame=frame.name,
        time_s=0.0,
        sweep_s=pattern.sweep_s,
        ego=Ego(np.eye(4), np.zeros(3), 0.0, np.zeros(3)),
        lidar=Lidar(world_from_lidar, pattern.name),
        cameras=_cameras(frame, calibration, world_from_lidar),
        instances=instances,
        static=f"worlds/{frame.name}.glb",
    )
    trusted = trust.measured(xyz, instances)
    return FrameTwin(twin, ground, trust, len(points), int(trusted.sum()), spread, without, brightness)


def _in_labelled_boxes(points: np.ndarray, labels: Labels, calibration: Calibration) -> np.ndarray:
    boxes = labels.boxes_velo(calibration)
    non_empty = boxes[np.flatnonzero(np.all(boxes.size > 0, axis=1))]
    return np.asarray(points_in_boxes(points, non_empty, MARGIN_M).any(0))


def _cameras(frame: Frame, calibration: Calibration, world_from_lidar: np.ndarray) -> dict[str, TwinCamera]:
    """Cameras of the calibration; their image size is KITTI's if there is no image."""
    pose = world_from_lidar @ calibration.rect_to_velo_matrix
    left, _, right = np.linalg.svd(pose[:3, :3])
    pose[:3, :3] = left @ right
    cameras = {}
    for number in calibration.cameras:
        name = f"image_{number}"
        height, width = frame.image(name).shape[:2] if frame.has(name) else (HEIGHT_PX, WIDTH_PX)
        cameras[name] = TwinCamera(pose, calibration.projection(number), width, height)
    return cameras


def check_labelled(frame: Frame) -> None:
    """Check that a frame has labels.

    Raises:
        FormatError: there are no labels.
    """
    if not frame.has("label_2"):
        raise FormatError(
            f"{frame.root}: no label_2/{frame.name}.txt; the twin is made from labels: "
            "add an empty file if the frame has no objects, or leave the frame out with --frames"
        )


@dataclass(frozen=True)
class Brightness:
    """Mean intensity (0–1), number and standard deviation of measured points."""

    mean: float
    points: int
    spread: float = 0.0

    @classmethod
    def of(cls, intensity: np.ndarray) -> Brightness:
        """Compute it from intensities (n,)."""
        if not len(intensity):
            return cls(0.0, 0)
        values = intensity.clip(0, 1).astype(np.float64)
        return cls(float(values.mean()), len(values), float(values.std()))


def ground_brightness(trust: Trust, xyz: np.ndarray, intensity: np.ndarray) -> Brightness:
    """Brightness of the points (n, 3), world axes, that are on trusted ground."""
    return Brightness.of(intensity[trust.measured(xyz, ())])


def _estimate_paint(
    instances: Sequence[Instance], xyz: np.ndarray, intensity: np.ndarray
) -> tuple[tuple[Instance, ...], np.ndarray]:
    """Set the paint of each instance to the mean intensity of the points (n, 3) in its box, if there are enough.

    Returns:
        The instances and the standard deviations (i,) of the intensities in their boxes.
    """
    painted, spread = [], np.full(len(instances), _DEFAULT_SPREAD)
    for row, instance in enumerate(instances):
        brightness = Brightness.of(intensity[in_box(xyz, instance, 0.0)])
        has_points = brightness.points >= _MIN_POINTS
        painted.append(replace(instance, paint=brightness.mean) if has_points else instance)
        spread[row] = brightness.spread if has_points else _DEFAULT_SPREAD
    return tuple(painted), spread

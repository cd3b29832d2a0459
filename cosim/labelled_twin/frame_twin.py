"""The twin of one measured frame, from its points and labels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from assets.mesh import Mesh
from cosim.drives.kitti import Calibration, Frame, Labels, points_in_boxes
from cosim.drives.twin import Ego, Lidar, TwinCamera, TwinFrame
from cosim.drives.twin.trust import MARGIN_M, Trust
from cosim.errors import FormatError
from cosim.labelled_twin.brightness import Brightness, estimate_paint, ground_brightness
from cosim.labelled_twin.ground_surface import REACH_M, fit_ground
from cosim.labelled_twin.objects import label_instances
from cosim.labelled_twin.road_cells import find_road_cells
from cosim.labelled_twin.scatter import body_scatter
from cosim.labelled_twin.trusted_ground import ground_mesh, trust_ground
from sensors.cameras.kitti_rig import HEIGHT_PX, WIDTH_PX, lidar_pose_ego
from sensors.pattern import Pattern

_CELL_REACH_M = REACH_M + 5.0


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
        instances, paint_sd = estimate_paint(instances, xyz, points[:, 3])
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

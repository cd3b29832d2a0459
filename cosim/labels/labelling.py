"""KITTI labels from exact geometry: truncation from the projected model, occlusion from visible pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.drives.kitti.boxes import Boxes
from cosim.drives.kitti.calibration import Calibration
from cosim.drives.kitti.image_boxes import NEAR_M, box_areas, clip_boxes
from cosim.drives.kitti.labels import DONT_CARE, Labels
from cosim.labels.annotators import Annotators
from sensors.scene import Instances, Scene

# KITTI has no class for buses and motorcycles; it labels them Misc.
KITTI_TYPE = {
    "car": "Car",
    "van": "Van",
    "truck": "Truck",
    "bus": "Misc",
    "tram": "Tram",
    "motorcycle": "Misc",
    "cyclist": "Cyclist",
    "pedestrian": "Pedestrian",
    "person_sitting": "Person_sitting",
}
_MAX_SAMPLES = 1600
_MAX_RANGE_M = 1e4
_MAX_LIFT_M = 0.03
_LABEL_ALL = Annotators(enabled=False)
# points that fill a unit box standing on the origin
_FILLED_BOX = np.stack(np.meshgrid(*(np.linspace(-0.5, 0.5, 9),) * 2, np.linspace(0, 1, 5)), -1).reshape(-1, 3)


class Labeller:
    """Labels the objects that a camera sees.

    Args:
        scene: scene with the meshes of the models.
        calibration: calibration of LiDAR and cameras; 2D boxes refer to `camera`.
        range_m: objects farther from the LiDAR become DontCare [m].
        min_pixels: objects with fewer visible pixels are not labelled.
        min_points: objects hit by fewer beams become DontCare.
        annotators: model of the annotators: objects that become DontCare (default: none) and occlusion levels.
        seed: seed of the annotators.
        camera: index of the camera of the instance image.
    """

    def __init__(
        self,
        scene: Scene,
        calibration: Calibration,
        *,
        range_m: float,
        min_pixels: int,
        min_points: int = 0,
        annotators: Annotators = _LABEL_ALL,
        seed: int = 0,
        camera: int = 2,
    ) -> None:
        self._scene = scene
        self._calibration = calibration
        self._P = calibration.projection(camera)
        self._centre = -np.linalg.solve(self._P[:, :3], self._P[:, 3])  # optical centre in camera axes
        self._range_m = range_m
        self._min_pixels = min_pixels
        self._min_points = min_points
        self._annotators, self._seed = annotators, seed

    def label(
        self,
        instances: Instances,
        lidar_pose: np.ndarray,
        instance_image: np.ndarray,
        points: np.ndarray | None = None,
    ) -> Labels:
        """Label a frame.

        Args:
            instances: movable objects without the ego vehicle.
            lidar_pose: (4, 4) world pose of the LiDAR.
            instance_image: (h, w) integers, index in `instances` + 1 of the visible instance, 0 elsewhere.
            points: (n,) number of beams that hit each instance; None: `min_points` is not applied.
        """
        seen = instance_image[instance_image > 0]
        pixels = np.bincount(seen, minlength=len(instances) + 1)[1 : len(instances) + 1]
        rows = np.flatnonzero(pixels >= self._min_pixels)
        camera_from_world = self._calibration.velo_to_rect_matrix @ np.linalg.inv(lidar_pose)
        clipped, truncated = self._image_boxes(instances, rows, camera_from_world, instance_image)
        boxes = boxes_in_lidar(instances, rows, lidar_pose)
        is_ignored = np.linalg.norm(boxes.centre, axis=1) > self._range_m
        height_px = np.diff(clipped[:, 1::2])[:, 0]
        is_ignored |= self._annotators.overlook([instances.ids[row] for row in rows], height_px, self._seed)
        if points is not None:
            is_ignored |= points[rows] < self._min_points
        hidden = np.zeros(len(rows))  # not computed for DontCare regions
        for i in np.flatnonzero(~is_ignored).tolist():
            hidden[i] = self._hidden_share(instances, int(rows[i]), clipped[i], camera_from_world, instance_image)
        labels = Labels.from_boxes(
            boxes,
            [KITTI_TYPE[instances.kinds[row]] for row in rows],
            self._calibration,
            bbox=clipped,
            truncated=truncated,
            occluded=self._annotators.occlusion(hidden),
        )
        return dont_care_where(labels, is_ignored)

    def _image_boxes(
        self, instances: Instances, rows: np.ndarray, camera_from_world: np.ndarray, instance_image: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tight boxes around the projected models within the image (n, 4), and the share outside it (n,).

        An object that extends behind the camera cannot be projected: its box is that of its visible pixels, and the
        share outside the image is computed from its volume.
        """
        height, width = instance_image.shape
        boxes, truncated = np.zeros((len(rows), 4)), np.zeros(len(rows))
        for i, row in enumerate(rows):
            camera_from_model = camera_from_world @ instances.poses[row]
            hull = self._scene.model(instances.models[row]).mesh.hull.astype(np.float64)
            points = _transform(camera_from_model, hull * instances.scales[row])
            if self._depth(points).min() > NEAR_M:
                uv = self._project(points)
                full = np.array([*uv.min(0), *uv.max(0)])
                boxes[i] = clip_boxes(full, width, height)
                truncated[i] = 1 - box_areas(boxes[i : i + 1])[0] / max(box_areas(full[None])[0], 1e-9)
            else:
                v, u = np.nonzero(instance_image == row + 1)
                boxes[i] = u.min(), v.min(), u.max(), v.max()
                volume = _transform(camera_from_model, _FILLED_BOX * instances.sizes[row])
                uv = self._project(volume)
                inside = (uv >= 0).all(1) & (uv <= [width - 1, height - 1]).all(1) & (self._depth(volume) > NEAR_M)
                truncated[i] = 1 - inside.mean()
        return boxes, truncated.clip(0, 1)

    def _depth(self, points: np.ndarray) -> np.ndarray:
        """Depths (n,) along the camera's optical axis [m]."""
        return points @ self._P[2, :3] + self._P[2, 3]

    def _project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) of points in camera axes; invalid for points behind the camera."""
        projected = points @ self._P[:, :3].T + self._P[:, 3]
        return projected[:, :2] / np.where(np.abs(projected[:, 2:]) > 1e-6, projected[:, 2:], 1e-6)

    def _hidden_share(
        self,
        instances: Instances,
        row: int,
        box: np.ndarray,
        camera_from_world: np.ndarray,
        instance_image: np.ndarray,
    ) -> float:
        """Share of the object's pixels that other objects hide, 0–1."""
        left, top = np.floor(box[:2]).astype(int)
        right, bottom = np.ceil(box[2:]).astype(int)
        step = max(1, int(np.sqrt((right - left) * (bottom - top) / _MAX_SAMPLES)))
        u, v = np.meshgrid(np.arange(left, right + 1, step), np.arange(top, bottom + 1, step))
        u, v = u.ravel(), v.ravel()
        direction = np.linalg.solve(self._P[:, :3], np.stack([u, v, np.ones_like(u)]).astype(float)).T
        world_from_model = instances.poses[row].copy()
        world_from_model[:3, :3] *= instances.scales[row]
        model_from_camera = np.linalg.inv(camera_from_world @ world_from_model)
        origin = model_from_camera[:3, :3] @ self._centre + model_from_camera[:3, 3]
        local_direction = (direction @ model_from_camera[:3, :3].T).astype(np.float32)
        _, triangle = self._scene.model(instances.models[row]).opaque.first_hit(
            np.tile(origin.astype(np.float32), (len(u), 1)), local_direction, np.full(len(u), _MAX_RANGE_M, np.float32)
        )
        is_covered = triangle >= 0
        is_visible = is_covered & (instance_image[v, u] == row + 1)
        return 1 - is_visible.sum() / max(is_covered.sum(), 1)


def boxes_in_lidar(instances: Instances, rows: np.ndarray, lidar_pose: np.ndarray) -> Boxes:
    """Upright boxes of the instances `rows` in LiDAR axes.

    KITTI's boxes rotate only about the vertical axis. If the true box is tilted relative to the LiDAR, the upright box
    would contain some road under the raised end. It is therefore lifted to the highest bottom corner of the true box,
    by at most 3 cm.
    """
    poses = np.linalg.inv(lidar_pose) @ instances.poses[rows]
    size = instances.sizes[rows]
    centre = poses[:, :3, 3] + poses[:, :3, 2] * size[:, 2:] / 2
    rise = np.abs(poses[:, 2, 0]) * size[:, 0] / 2 + np.abs(poses[:, 2, 1]) * size[:, 1] / 2
    centre[:, 2] += np.minimum(rise, _MAX_LIFT_M)
    return Boxes(centre, size, np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))


def dont_care_where(labels: Labels, mask: np.ndarray) -> Labels:
    """Turn the labels of a mask (n,) bool into DontCare regions, which come last."""
    order = np.argsort(mask, kind="stable")
    labels, mask = labels[order], mask[order]

    def blank(values: np.ndarray, placeholder: float) -> np.ndarray:
        return np.where(mask.reshape(-1, *(1,) * (values.ndim - 1)), placeholder, values)

    return replace(
        labels,
        type=tuple(DONT_CARE if ignored else name for name, ignored in zip(labels.type, mask, strict=True)),
        truncated=blank(labels.truncated, -1),
        occluded=blank(labels.occluded, -1),
        alpha=blank(labels.alpha, -10),
        dimensions=blank(labels.dimensions, -1),
        location=blank(labels.location, -1000),
        rotation_y=blank(labels.rotation_y, -10),
    )


def _transform(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Transform points (n, 3) by a matrix (4, 4)."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]

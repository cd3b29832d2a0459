"""KITTI labels from exact geometry: truncation from the projected model, occlusion from counted pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull

from cosim.drives.kitti.boxes import Boxes
from cosim.drives.kitti.calibration import Calibration
from cosim.drives.kitti.image_boxes import NEAR_M, box_areas, clip_boxes
from cosim.drives.kitti.labels import DONT_CARE, Labels
from cosim.labels.annotators import Annotators
from sensors.scene import Instances, Scene

# KITTI knows no bus and no motorcycle; it labels such things Misc.
KITTI_TYPE = {
    "car": "Car",
    "van": "Van",
    "truck": "Truck",
    "bus": "Misc",
    "motorcycle": "Misc",
    "cyclist": "Cyclist",
    "pedestrian": "Pedestrian",
}
_MOST_SAMPLES = 1600
_FARTHEST_M = 1e4
_MOST_LIFT_M = 0.03
_SHARP_EYED = Annotators(enabled=False)
# points that fill a unit box standing on the origin
_FILLED_BOX = np.stack(np.meshgrid(*(np.linspace(-0.5, 0.5, 9),) * 2, np.linspace(0, 1, 5)), -1).reshape(-1, 3)


class Labeller:
    """Labels what a camera sees.

    Args:
        scene: gives the shapes of the models.
        calibration: LiDAR and cameras; 2D boxes are those of `camera`.
        range_m: what stands farther from the LiDAR becomes DontCare [m].
        min_pixels: what shows fewer pixels is not labelled.
        min_points: what returns fewer beams becomes DontCare.
        annotators: whom they overlook becomes DontCare, by default nobody; and what they call occluded.
        seed: of whom they overlook.
        camera: index of the camera whose instance image is given.
    """

    def __init__(
        self,
        scene: Scene,
        calibration: Calibration,
        *,
        range_m: float,
        min_pixels: int,
        min_points: int = 0,
        annotators: Annotators = _SHARP_EYED,
        seed: int = 0,
        camera: int = 2,
    ) -> None:
        self._scene = scene
        self._calibration = calibration
        self._P = calibration.projection(camera)
        self._range_m = range_m
        self._min_pixels = min_pixels
        self._min_points = min_points
        self._annotators, self._seed = annotators, seed
        self._hulls: dict[str, np.ndarray] = {}

    def label(
        self,
        instances: Instances,
        lidar_pose: np.ndarray,
        instance_image: np.ndarray,
        points: np.ndarray | None = None,
    ) -> Labels:
        """Labels of a frame.

        Args:
            instances: what moves, without the ego vehicle.
            lidar_pose: (4, 4) world pose of the LiDAR.
            instance_image: (h, w) integers, row of `instances` + 1 where one is seen, 0 elsewhere.
            points: (n,) beams that each instance returns; None: as many as needed.
        """
        pixels = np.bincount(instance_image.ravel(), minlength=len(instances) + 1)[1 : len(instances) + 1]
        rows = np.flatnonzero(pixels >= self._min_pixels)
        camera_from_world = self._calibration.velo_to_rect_matrix @ np.linalg.inv(lidar_pose)
        clipped, truncated = self._image_boxes(instances, rows, camera_from_world, instance_image)
        boxes = boxes_in_lidar(instances, rows, lidar_pose)
        lost = np.linalg.norm(boxes.centre, axis=1) > self._range_m
        height_px = np.diff(clipped[:, 1::2])[:, 0]
        lost |= self._annotators.overlook([instances.ids[row] for row in rows], height_px, self._seed)
        if points is not None:
            lost |= points[rows] < self._min_points
        hidden = np.zeros(len(rows))  # of those who are left to DontCare nobody asks
        for i in np.flatnonzero(~lost).tolist():
            hidden[i] = self._hidden_share(instances, int(rows[i]), clipped[i], camera_from_world, instance_image)
        labels = Labels.from_boxes(
            boxes,
            [KITTI_TYPE[instances.kinds[row]] for row in rows],
            self._calibration,
            bbox=clipped,
            truncated=truncated,
            occluded=self._annotators.occlusion(hidden),
        )
        return dont_care_where(labels, lost)

    def _image_boxes(
        self, instances: Instances, rows: np.ndarray, camera_from_world: np.ndarray, instance_image: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tight boxes around the projected models within the image (n, 4), and the share outside it (n,).

        What reaches behind the camera has no projection to bound: its box is that of its pixels, and the share
        outside is one of its volume.
        """
        height, width = instance_image.shape
        boxes, truncated = np.zeros((len(rows), 4)), np.zeros(len(rows))
        for i, row in enumerate(rows):
            camera_from_model = camera_from_world @ instances.poses[row]
            points = _carried(camera_from_model, self._hull(instances.models[row]) * instances.scales[row])
            if self._depth(points).min() > NEAR_M:
                uv = self._project(points)
                full = np.array([*uv.min(0), *uv.max(0)])
                boxes[i] = clip_boxes(full, width, height)
                truncated[i] = 1 - box_areas(boxes[i : i + 1])[0] / max(box_areas(full[None])[0], 1e-9)
            else:
                v, u = np.nonzero(instance_image == row + 1)
                boxes[i] = u.min(), v.min(), u.max(), v.max()
                volume = _carried(camera_from_model, _FILLED_BOX * instances.sizes[row])
                uv = self._project(volume)
                inside = (uv >= 0).all(1) & (uv <= [width - 1, height - 1]).all(1) & (self._depth(volume) > NEAR_M)
                truncated[i] = 1 - inside.mean()
        return boxes, truncated.clip(0, 1)

    def _depth(self, points: np.ndarray) -> np.ndarray:
        """Depths (n,) along the camera's optical axis [m]."""
        return points @ self._P[2, :3] + self._P[2, 3]

    def _project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (n, 2) of points in camera axes; those behind the camera give nonsense."""
        projected = points @ self._P[:, :3].T + self._P[:, 3]
        return projected[:, :2] / np.where(np.abs(projected[:, 2:]) > 1e-6, projected[:, 2:], 1e-6)

    def _hull(self, name: str) -> np.ndarray:
        """Corners of a model's convex hull, (k, 3) in the model frame."""
        if name not in self._hulls:
            vertices = self._scene.model(name).vertices
            self._hulls[name] = vertices[ConvexHull(vertices).vertices].astype(np.float64)
        return self._hulls[name]

    def _hidden_share(
        self,
        instances: Instances,
        row: int,
        box: np.ndarray,
        camera_from_world: np.ndarray,
        instance_image: np.ndarray,
    ) -> float:
        """Share of the pixels the object would cover that show something else, 0–1."""
        left, top = np.floor(box[:2]).astype(int)
        right, bottom = np.ceil(box[2:]).astype(int)
        step = max(1, int(np.sqrt((right - left) * (bottom - top) / _MOST_SAMPLES)))
        u, v = np.meshgrid(np.arange(left, right + 1, step), np.arange(top, bottom + 1, step))
        u, v = u.ravel(), v.ravel()
        camera_matrix, offset = self._P[:, :3], np.linalg.solve(self._P[:, :3], self._P[:, 3])
        direction = np.linalg.solve(camera_matrix, np.stack([u, v, np.ones_like(u)]).astype(float)).T
        placed = instances.poses[row].copy()
        placed[:3, :3] *= instances.scales[row]
        model_from_camera = np.linalg.inv(camera_from_world @ placed)
        origin = model_from_camera[:3, :3] @ -offset + model_from_camera[:3, 3]
        turned = (direction @ model_from_camera[:3, :3].T).astype(np.float32)
        _, triangle = self._scene.model(instances.models[row]).opaque.first_hit(
            np.tile(origin.astype(np.float32), (len(u), 1)), turned, np.full(len(u), _FARTHEST_M, np.float32)
        )
        covered = triangle >= 0
        seen = covered & (instance_image[v, u] == row + 1)
        return 1 - seen.sum() / max(covered.sum(), 1)


def boxes_in_lidar(instances: Instances, rows: np.ndarray, lidar_pose: np.ndarray) -> Boxes:
    """Upright boxes of some instances in LiDAR axes.

    KITTI's boxes turn about one axis only. Where the true box is tilted against the LiDAR, the road under its
    raised end would lie inside the upright one; that is lifted onto its highest bottom corner, by 3 cm at most.
    """
    poses = np.linalg.inv(lidar_pose) @ instances.poses[rows]
    size = instances.sizes[rows]
    centre = poses[:, :3, 3] + poses[:, :3, 2] * size[:, 2:] / 2
    rise = np.abs(poses[:, 2, 0]) * size[:, 0] / 2 + np.abs(poses[:, 2, 1]) * size[:, 1] / 2
    centre[:, 2] += np.minimum(rise, _MOST_LIFT_M)
    return Boxes(centre, size, np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))


def dont_care_where(labels: Labels, lost: np.ndarray) -> Labels:
    """Labels with some (n,) bool turned into DontCare regions, those last."""
    order = np.argsort(lost, kind="stable")
    labels, lost = labels[order], lost[order]

    def blank(values: np.ndarray, placeholder: float) -> np.ndarray:
        return np.where(lost.reshape(-1, *(1,) * (values.ndim - 1)), placeholder, values)

    return replace(
        labels,
        type=tuple(DONT_CARE if away else name for name, away in zip(labels.type, lost, strict=True)),
        truncated=blank(labels.truncated, -1),
        occluded=blank(labels.occluded, -1),
        alpha=blank(labels.alpha, -10),
        dimensions=blank(labels.dimensions, -1),
        location=blank(labels.location, -1000),
        rotation_y=blank(labels.rotation_y, -10),
    )


def _carried(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) carried by a (4, 4) motion."""
    return points @ matrix[:3, :3].T + matrix[:3, 3]

"""Ray tracing with motion: each ray is traced at its own time, in each instance's frame at that time."""

from __future__ import annotations

import numpy as np

from sensors.hits import Hits
from sensors.intersection import meet_instance, meet_static, yawed
from sensors.motion import EgoMotion, moved_poses
from sensors.ray_index import RayIndex
from sensors.rays import Rays
from sensors.scene import Instances, Scene

_CORNERS = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
_INSTANTS = 5
_WINDOW_MARGIN_M = 0.03  # covers the bow of a turning box's path between two instants


class MotionTracer:
    """Traces a fixed set of rays that a moving sensor emits one after another.

    Args:
        rays: beams in the sensor's own axes.
        range_m: nearest and farthest distance at which a surface counts [m].
    """

    def __init__(self, rays: Rays, range_m: tuple[float, float]) -> None:
        self.rays = rays
        self._near, self._far = range_m
        self._index = RayIndex(rays)

    def trace(
        self,
        scene: Scene,
        ego: EgoMotion,
        lidar_in_ego: np.ndarray,
        time_s: np.ndarray,
        instances: Instances,
        *,
        panes: bool = True,
    ) -> tuple[Hits, np.ndarray, np.ndarray]:
        """First pane and first solid surface of every beam.

        Args:
            scene: what there is.
            ego: the vehicle at the pose time, and its motion.
            lidar_in_ego: (4, 4) pose of the sensor in the vehicle.
            time_s: (n,) float32 instant of each ray from the pose time.
            instances: what moves, at the pose time.
            panes: whether the panes of instances are included; without them their glass is ignored.

        Returns:
            Hits; true optical centres from the sensor's place at the pose time, and directions, (n, 3) float32 in
            world axes.
        """
        origin, direction = _carried_rays(self.rays, ego, lidar_in_ego, time_s)
        # Around the sensor, so that float32 keeps its digits.
        centre = (ego.pose @ lidar_in_ego)[:3, 3]
        start, limit = origin + centre.astype(np.float32), np.full(len(self.rays), self._far, np.float32)
        solid, pane = meet_static(scene.static, start, direction, limit, self._near)
        for row, beams in self._windows(scene, ego, lidar_in_ego, time_s, instances, solid.distance):
            meet_instance(
                scene, instances, row, beams, origin, direction, centre, time_s, solid, pane, self._near, panes=panes
            )
        solid.settle()
        pane.settle()
        beam = np.flatnonzero(pane.distance < solid.distance).astype(np.int32)
        hits = Hits(
            rays=self.rays,
            pose=ego.pose @ lidar_in_ego,
            solid=solid.surface(),
            pane_beam=beam,
            pane=pane.surface(beam),
            paint=instances.paint,
            table=scene.table,
        )
        return hits, origin, direction

    def _windows(
        self,
        scene: Scene,
        ego: EgoMotion,
        lidar_in_ego: np.ndarray,
        time_s: np.ndarray,
        instances: Instances,
        way_m: np.ndarray,
    ) -> list[tuple[int, np.ndarray]]:
        """Instances and the rays that may meet them at any instant of the sweep; `way_m` (n,) is open to each ray."""
        if not len(instances):
            return []
        bounds = np.stack([scene.model(name).bounds for name in instances.models])
        corner = np.where(_CORNERS[None], bounds[:, None, 1], bounds[:, None, 0]) * instances.scales[:, None, :]
        corners, nearest = [], []
        for instant in np.linspace(time_s.min(), time_s.max(), _INSTANTS):
            placed = moved_poses(instances.poses, instances.velocity_mps, instances.yaw_rate_radps, float(instant))
            seen = np.linalg.inv(ego.pose_at(float(instant)) @ lidar_in_ego) @ placed
            corners.append(np.einsum("kij,kcj->kci", seen[:, :3, :3], corner) + seen[:, None, :3, 3])
            sensor = -np.einsum("kji,kj->ki", seen[:, :3, :3], seen[:, :3, 3])
            low, high = bounds[:, 0] * instances.scales, bounds[:, 1] * instances.scales
            nearest.append(np.linalg.norm(np.maximum(np.maximum(low - sensor, sensor - high), 0), axis=1))
        swept = np.concatenate(corners, axis=1)
        middle = swept.mean(1, keepdims=True)
        swept += np.sign(swept - middle) * _WINDOW_MARGIN_M
        near = np.maximum(np.min(nearest, axis=0) - 0.1, 0)
        reach = np.flatnonzero(near < self._far)
        reach = reach[np.argsort(near[reach], kind="stable")]
        beams, box = self._index.window_pairs(swept[reach], near[reach])
        open_way = way_m[beams] > near[reach].astype(np.float32)[box]
        beams, box = beams[open_way], box[open_way]
        ends = np.searchsorted(box, np.arange(len(reach) + 1))
        return [(int(row), beams[ends[i] : ends[i + 1]]) for i, row in enumerate(reach) if ends[i] < ends[i + 1]]


def _carried_rays(
    rays: Rays, ego: EgoMotion, lidar_in_ego: np.ndarray, time_s: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Origins, from the sensor's place at the pose time, and directions of the rays in world axes, (n, 3) float32."""
    now = (ego.pose @ lidar_in_ego)[:3, :3].astype(np.float32)
    arm = (ego.pose[:3, :3] @ lidar_in_ego[:3, 3]).astype(np.float32)
    angle = np.float32(ego.yaw_rate_radps) * time_s
    direction = yawed(rays.direction @ now.T, angle)
    lever = rays.origin @ now.T + arm if rays.origin.any() else np.broadcast_to(arm, direction.shape)
    travelled = time_s[:, None] * np.asarray(ego.velocity_mps, np.float32)
    travelled += yawed(lever, angle) - arm
    return travelled, direction

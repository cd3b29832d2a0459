"""The posed scene as a sensor in motion sees it: traces whole revolutions and single further rays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sensors.beams import Beams
from sensors.hits import Hits, Surface
from sensors.intersection import shoot
from sensors.motion import EgoMotion, instances_at
from sensors.motion_tracing import MotionTracer
from sensors.rays import Rays
from sensors.scene import Instances, Scene
from sensors.tracing import Tracer


@dataclass(frozen=True, eq=False)
class Traced:
    """Hits of the beams of a revolution, with their true origins, directions and times.

    Attributes:
        hits: surfaces by beam.
        moving: where each beam has its own pose: optical centres from that of the pose time and directions, (n, 3)
            float32 world axes, and instants (n,).
        delay_s: instant of all beams, where they share one pose.
    """

    hits: Hits
    moving: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
    delay_s: float = 0.0

    @property
    def origin(self) -> np.ndarray:
        """True optical centres, (n, 3) float64 world axes; not cached, because many scans are in memory at once."""
        if self.moving is not None:
            return self.hits.pose[:3, 3] + self.moving[0]
        pose = self.hits.pose
        return self.hits.rays.origin.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]

    @cached_property
    def direction(self) -> np.ndarray:
        """True unit directions, (n, 3) float32 world axes."""
        if self.moving is not None:
            return self.moving[1]
        return self.hits.direction

    @property
    def time_s(self) -> np.ndarray:
        """Instants at which the world was seen, (n,) or one for all, from the pose time."""
        return np.array([self.delay_s], np.float32) if self.moving is None else self.moving[2]


class TracerCache:
    """Tracers of rays that come again frame after frame: sorting rays costs about as much as tracing them."""

    def __init__(self, range_m: tuple[float, float]) -> None:
        self._range_m = range_m
        self._tracers: dict[str, Tracer | MotionTracer] = {}
        self._fans: dict[str, tuple[Beams, Rays]] = {}

    def fan(self, slot: str, beams: Beams, aside: Callable[[np.ndarray], np.ndarray]) -> Rays:
        """Rays around beams, made again if the beams have changed; see `World.trace_around`."""
        kept = self._fans.get(slot)
        if kept is None or not _same(kept[0], beams):
            directions = aside(beams.direction)
            rays, count = beams.rays, directions.shape[1]
            columns = (beams.origin, directions.reshape(-1, 3), rays.ring, rays.azimuth, rays.time_s)
            repeated = [np.repeat(column, 1 if row == 1 else count, axis=0) for row, column in enumerate(columns)]
            kept = self._fans[slot] = beams, Rays(*repeated)
        return kept[1]

    def fixed(self, slot: str, rays: Rays) -> Tracer:
        """A tracer of rays that all leave at once."""
        tracer = self._tracers.get(slot)
        if not isinstance(tracer, Tracer) or not _same(tracer.rays, rays):
            tracer = self._tracers[slot] = Tracer(rays, self._range_m)
        return tracer

    def moving(self, slot: str, rays: Rays) -> MotionTracer:
        """A tracer of rays that leave one by one."""
        tracer = self._tracers.get(slot)
        if not isinstance(tracer, MotionTracer) or not _same(tracer.rays, rays):
            tracer = self._tracers[slot] = MotionTracer(rays, self._range_m)
        return tracer


class World:
    """One frame's scene.

    Args:
        scene: what there is.
        pose: (4, 4) nominal world pose of the LiDAR at the pose time.
        instances: what moves, at the pose time.
        ego: the vehicle that carries the LiDAR.
        range_m: nearest and farthest measurable range.
        tracers: kept from frame to frame.
    """

    def __init__(
        self,
        scene: Scene,
        pose: np.ndarray,
        instances: Instances,
        ego: EgoMotion,
        range_m: tuple[float, float],
        tracers: TracerCache,
    ) -> None:
        self._scene = scene
        self.pose = pose
        self.instances = instances
        self.ego = ego
        self._range_m = range_m
        self._tracers = tracers

    def trace(self, beams: Beams, slot: str = "beams", *, panes: bool = True) -> Traced:
        """First pane and first solid surface of every beam.

        Args:
            beams: how they leave.
            slot: names the fan whose tracer is kept.
            panes: whether the panes of instances are included.
        """
        rays = Rays(beams.origin, beams.direction, beams.rays.ring, beams.rays.azimuth, beams.rays.time_s)
        if beams.firing_s is None:
            pose = self._lidar_pose(beams)
            instances = instances_at(self.instances, beams.delay_s)
            hits = self._tracers.fixed(slot, rays).trace(self._scene, pose, instances, panes=panes)
            return Traced(hits, delay_s=beams.delay_s)
        tracer = self._tracers.moving(slot, rays)
        lidar_in_ego = beams.body @ np.linalg.solve(self.ego.pose, self.pose) @ beams.mount
        time_s = beams.firing_s + np.float32(beams.delay_s)
        hits, origin, direction = tracer.trace(self._scene, self.ego, lidar_in_ego, time_s, self.instances, panes=panes)
        return Traced(hits, (origin, direction, time_s))

    def trace_around(self, beams: Beams, aside: Callable[[np.ndarray], np.ndarray], slot: str) -> Hits:
        """The solid surfaces that k further rays round each beam met, in row k · beam + ray.

        Args:
            beams: the n beams.
            aside: function that returns directions of further rays, (n, k, 3) float32, from those of the beams, (n, 3).
            slot: names the fan whose rays and tracer are kept: one name, one `aside`.
        """
        fan = self._tracers.fan(slot, beams, aside)
        firing_s = None if beams.firing_s is None else np.repeat(beams.firing_s, len(fan) // len(beams.rays))
        around = replace(beams, rays=fan, origin=fan.origin, direction=fan.direction, firing_s=firing_s)
        return self.trace(around, slot, panes=False).hits

    def shoot(self, origin: np.ndarray, direction: np.ndarray, time_s: np.ndarray, limit_m: float) -> Surface:
        """First solid surface along single rays (k, 3) in world axes, each at its own instant (k,)."""
        return shoot(self._scene, self.instances, origin, direction, time_s, limit_m)

    def _lidar_pose(self, beams: Beams) -> np.ndarray:
        if beams.delay_s == 0 and np.array_equal(beams.body, np.eye(4)):
            return self.pose @ beams.mount
        lidar_in_ego = np.linalg.solve(self.ego.pose, self.pose)
        return self.ego.pose_at(beams.delay_s) @ beams.body @ lidar_in_ego @ beams.mount


def _same(left: Rays | Beams, right: Rays | Beams) -> bool:
    """Whether rays are the same in the sensor's axes."""
    return _equal(left.direction, right.direction) and _equal(left.origin, right.origin)


def _equal(left: np.ndarray, right: np.ndarray) -> bool:
    return left is right or np.array_equal(left, right)

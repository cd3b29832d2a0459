"""The frames of a drive with what a sensor's true beams meet in their twin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.edges import Neighbours
from cosim.discrepancy.observed import Observed, observe
from cosim.kitti import Drive
from cosim.twin.scene import TwinScenes, ego_motion, lidar_pose, scene_instances
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams
from sensors.effects.base import Effect
from sensors.motion import EgoMotion
from sensors.rays import Rays
from sensors.scene import Instances
from sensors.sensor_model import SensorModel
from sensors.shot import Shot
from sensors.world import TracerCache, World


@dataclass(frozen=True, eq=False)
class TracedFrame:
    """One frame, measured and traced.

    Attributes:
        name: of the frame.
        time_s: pose time.
        observed: what was measured, by beam.
        shot: what the model's true beams met, by beam; with its world, so that effects can trace on.
        edge: (n,) bool: beams whose outcome is ambiguous, because a touch aside the world is another.
        ego, instances: at the pose time.
    """

    name: str
    time_s: float
    observed: Observed
    shot: Shot
    edge: np.ndarray
    ego: EgoMotion
    instances: Instances


class FrameTracer:
    """Traces the frames of a drive with a sensor's beam effects.

    Args:
        drive: with points and a twin.
        pattern_of: the sensor; its pattern is what points are sorted onto.
    """

    def __init__(self, drive: Drive, sensor: SensorModel) -> None:
        self.drive = drive
        self.sensor = sensor
        self._scenes = TwinScenes(drive)
        self._rays: Rays = sensor.pattern.rays()
        self._neighbours = Neighbours(self._rays)
        self._tracers = TracerCache(sensor.pattern.range_m)

    def trace(self, name: str, effects: tuple[Effect, ...]) -> TracedFrame:
        """One frame, as beams changed by `effects` meet it."""
        frame = self.drive[name]
        twin = frame.twin
        instances, ego, pattern = scene_instances(twin.instances), ego_motion(twin), self.sensor.pattern
        world = World(self._scenes.of(frame), lidar_pose(twin), instances, ego, pattern.range_m, self._tracers)
        before = Shot(pattern, self._rays, world=world, frame_time_s=twin.time_s)
        streams = Streams(np.random.default_rng(0))
        beams = act_on_beams(_in_order(effects), Beams.nominal(self._rays), before, streams, self.sensor.origin)
        traced = world.trace(beams)
        return TracedFrame(
            name=name,
            time_s=twin.time_s,
            observed=observe(frame, pattern, self._rays),
            shot=Shot(pattern, beams.rays, beams=beams, traced=traced, world=world, frame_time_s=twin.time_s),
            edge=self._neighbours.at_edge(traced.hits),
            ego=ego,
            instances=instances,
        )


def _in_order(effects: tuple[Effect, ...]) -> tuple[Effect, ...]:
    return tuple(sorted(effects, key=lambda effect: effect.phase))

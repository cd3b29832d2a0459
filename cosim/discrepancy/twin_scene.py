"""The twin of a drive as something that can be traced."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from cosim.kitti import Drive, Frame
from cosim.twin import read_glb
from cosim.twin.frame import Instance, TwinFrame
from sensors.motion import EgoMotion
from sensors.scene import Instances, Scene


class TwinScenes:
    """Scenes of a drive's frames; worlds and models are built once.

    Args:
        drive: with a twin.
    """

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self._static: tuple[object, Scene] | None = None

    def of(self, frame: Frame) -> Scene:
        """The scene of a frame; the world last used is kept.

        Raises:
            CosimError: the twin lacks its world or a model, or they cannot be read.
        """
        paths = frame.static_paths
        if self._static is None or self._static[0] != paths:
            world = Mesh.merge([read_glb(path) for path in paths])
            self._static = (paths, Scene(world, self._model))
        return self._static[1]

    def _model(self, name: str) -> Mesh:
        return read_glb(self._drive.model_path(name))


def lidar_pose(twin: TwinFrame) -> np.ndarray:
    """(4, 4) world pose of the LiDAR at the pose time."""
    return twin.ego.pose @ twin.lidar.pose_ego


def ego_motion(twin: TwinFrame) -> EgoMotion:
    """The ego vehicle at the pose time."""
    ego = twin.ego
    return EgoMotion(ego.pose, ego.velocity_mps, ego.yaw_rate_radps, ego.acceleration_mps2)


def scene_instances(instances: tuple[Instance, ...]) -> Instances:
    """What can move, as a struct of arrays; colours are not known to a twin."""
    count = len(instances)

    def column(name: str, *shape: int) -> np.ndarray:
        return np.array([getattr(row, name) for row in instances], float).reshape(count, *shape)

    sizes = np.stack([column("length_m"), column("width_m"), column("height_m")], 1)
    return Instances(
        ids=tuple(row.id for row in instances),
        kinds=tuple(row.kind for row in instances),
        models=tuple(row.model for row in instances),
        poses=column("pose", 4, 4),
        scales=column("scale", 3),
        sizes=sizes,
        velocity_mps=column("velocity_mps", 3),
        yaw_rate_radps=column("yaw_rate_radps"),
        paint=column("paint").astype(np.float32),
        rgb=np.full((count, 3), 0.5, np.float32),
    )

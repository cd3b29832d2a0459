"""The twin of a drive as something that can be traced."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from assets.materials import MaterialTable
from assets.mesh import Mesh
from cosim.drives.kitti.drive import Drive
from cosim.drives.kitti.frame import Frame
from cosim.drives.twin.foreign import twin_materials
from cosim.drives.twin.frame import Instance, TwinFrame
from cosim.drives.twin.glb import read_glb
from sensors.motion import EgoMotion
from sensors.scene import Instances, Scene, TracedModel

_GRAY = 0.5  # twins have no visible colours; rays need none


class TwinScenes:
    """Scenes of a drive's frames, the last world kept; models are read once.

    Args:
        drive: holds `twin/`.
        threads: threads that share a query of the static world.
        table: materials; by default those of the drive.
    """

    def __init__(self, drive: Drive, *, threads: int = 1, table: MaterialTable | None = None) -> None:
        self._drive = drive
        self._threads = threads
        self._table = twin_materials(drive) if table is None else table
        self._models: dict[str, TracedModel] = {}
        self._files: tuple[Path, ...] = ()
        self._scene: Scene | None = None

    def of(self, frame: Frame) -> Scene:
        """The scene in which a frame was taken.

        Raises:
            CosimError: the twin has no static world, or one of its files is damaged.
        """
        files = frame.static_paths
        if self._scene is None or files != self._files:
            self._scene = Scene(
                Mesh.merge([read_glb(file, table=self._table) for file in files]),
                self._model,
                self._threads,
                self._table,
                self._models,
            )
            self._files = files
        return self._scene

    def _model(self, name: str) -> Mesh:
        return read_glb(self._drive.model_path(name), table=self._table)


def scene_instances(things: tuple[Instance, ...]) -> Instances:
    """Movable objects as a struct of arrays; twins have no colours."""

    def column(values: list, *shape: int) -> np.ndarray:
        return np.array(values, np.float64).reshape(len(things), *shape)

    return Instances(
        ids=tuple(thing.id for thing in things),
        kinds=tuple(thing.kind for thing in things),
        models=tuple(thing.model for thing in things),
        poses=column([thing.pose for thing in things], 4, 4),
        scales=column([thing.scale for thing in things], 3),
        sizes=column([(thing.length_m, thing.width_m, thing.height_m) for thing in things], 3),
        velocity_mps=column([thing.velocity_mps for thing in things], 3),
        yaw_rate_radps=column([thing.yaw_rate_radps for thing in things]),
        paint=column([thing.paint for thing in things]).astype(np.float32),
        rgb=np.full((len(things), 3), _GRAY, np.float32),
    )


def ego_motion(twin: TwinFrame) -> EgoMotion:
    """The vehicle that carries the sensors, and its motion."""
    ego = twin.ego
    return EgoMotion(ego.pose, ego.velocity_mps, ego.yaw_rate_radps, ego.acceleration_mps2)


def lidar_pose(twin: TwinFrame) -> np.ndarray:
    """(4, 4) nominal world pose of the LiDAR at the pose time."""
    return twin.ego.pose @ twin.lidar.pose_ego

"""ROS 2 messages in MCAP files: scans, images with their calibration, and poses; a file a sequence.

sensor_msgs/PointCloud2, CompressedImage and CameraInfo, tf2_msgs/TFMessage as ROS 2 Humble defines them. Frames of
reference are `map`, `base_link`, `lidar`, `lidar_NAME` of additional ones and the cameras' names, and `world`
where the network's files have other coordinates than the twin; stamps count from the beginning of the simulation.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cosim.drives.kitti import Drive, Frame
from cosim.drives.twin.frame import TwinCamera
from cosim.export.source import Sequence, WorldPoses, demand, lidar_frames, needed, sequences

_POINT = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "<f4"),
        ("ring", "<u2"),
        ("time", "<f4"),
        ("return_no", "u1"),
    ]
)
_ROS_TYPE = {"<f4": 7, "<u2": 4, "|u1": 2}  # sensor_msgs/PointField
_NS = 1_000_000_000
_MODELS = {"brown": "plumb_bob", "fisheye": "equidistant"}


def export_mcap(drive: Drive, folder: Path, on_frame: Callable[[], None]) -> dict[str, int]:
    """Write `SEQUENCE/`, a ROS 2 bag whose storage is MCAP."""
    demand(drive, "twin/frames", "mcap")
    found, messages, world = sequences(drive), 0, WorldPoses(drive)
    for sequence in found:
        target = folder / sequence.name
        shutil.rmtree(target, ignore_errors=True)  # a bag is written whole or not at all
        messages += _write(drive, sequence, target, world, on_frame)
    return {"frames": len(drive), "sequences": len(found), "messages": messages}


def _write(drive: Drive, sequence: Sequence, target: Path, world: WorldPoses, on_frame: Callable[[], None]) -> int:
    rosbag2, typesys = needed("rosbags.rosbag2"), needed("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    count = 0
    with rosbag2.Writer(target, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}
        for frame in sequence:
            stamp = round(frame.twin.time_s * _NS)
            for topic, message in _Messages(store, drive, frame, stamp, world.origin_m(frame)).all():
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=store)
                writer.write(connections[topic], stamp, store.serialize_cdr(message, kind))
                count += 1
            on_frame()
    return count


class _Messages:
    """The messages of one frame."""

    def __init__(self, store: Any, drive: Drive, frame: Frame, stamp: int, origin_m: np.ndarray) -> None:
        self._types, self._frame, self._stamp, self._origin_m = store.types, frame, stamp, origin_m
        others = list(lidar_frames(drive, frame).items())[1:]
        self._lidars = {"lidar": frame} | {f"lidar_{name}": seen for name, seen in others}

    def all(self) -> list[tuple[str, Any]]:
        """Topics and messages."""
        found = [(f"/{name}/points", self._cloud(name, seen)) for name, seen in self._lidars.items()]
        found.append(("/tf", self._transforms()))
        for part, camera in self._frame.twin.cameras.items():
            source = self._frame.find(part)
            if source is not None:
                found.append((f"/{part}/image/compressed", self._image(part, source)))
                found.append((f"/{part}/camera_info", self._camera_info(part, camera)))
        return found

    def _header(self, frame_id: str) -> Any:
        time = self._types["builtin_interfaces/msg/Time"](sec=self._stamp // _NS, nanosec=self._stamp % _NS)
        return self._types["std_msgs/msg/Header"](stamp=time, frame_id=frame_id)

    def _cloud(self, name: str, frame: Frame) -> Any:
        points, rays = frame.points, frame.rays
        rows = np.zeros(len(points), _POINT)
        rows["x"], rows["y"], rows["z"], rows["intensity"] = points.T
        rows["ring"], rows["time"], rows["return_no"] = rays.ring, rays.time_s, rays.return_no
        field = self._types["sensor_msgs/msg/PointField"]
        fields = _POINT.fields or {}
        return self._types["sensor_msgs/msg/PointCloud2"](
            header=self._header(name),
            height=1,
            width=len(rows),
            fields=[
                field(name=column, offset=int(where[1]), datatype=_ROS_TYPE[where[0].str], count=1)
                for column, where in fields.items()
            ],
            is_bigendian=False,
            point_step=_POINT.itemsize,
            row_step=_POINT.itemsize * len(rows),
            data=np.frombuffer(rows.tobytes(), np.uint8),
            is_dense=True,
        )

    def _transforms(self) -> Any:
        twin = self._frame.twin
        found = [self._transform("map", "base_link", twin.ego.pose)]
        if self._origin_m.any():
            map_pose = np.eye(4)
            map_pose[:3, 3] = self._origin_m
            found.insert(0, self._transform("world", "map", map_pose))
        for name, seen in self._lidars.items():
            found.append(self._transform("base_link", name, seen.twin.lidar.pose_ego))
        for part, camera in twin.cameras.items():
            found.append(self._transform("base_link", part, camera.pose_ego))
        return self._types["tf2_msgs/msg/TFMessage"](transforms=found)

    def _transform(self, parent: str, child: str, pose: np.ndarray) -> Any:
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
        moved = self._types["geometry_msgs/msg/Vector3"](*map(float, pose[:3, 3]))
        turned = self._types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w)
        placed = self._types["geometry_msgs/msg/Transform"](translation=moved, rotation=turned)
        stamped = self._types["geometry_msgs/msg/TransformStamped"]
        return stamped(header=self._header(parent), child_frame_id=child, transform=placed)

    def _image(self, part: str, source: Path) -> Any:
        data = np.frombuffer(source.read_bytes(), np.uint8)
        kind = self._types["sensor_msgs/msg/CompressedImage"]
        return kind(header=self._header(part), format=source.suffix[1:], data=data)

    def _camera_info(self, part: str, camera: TwinCamera) -> Any:
        region = self._types["sensor_msgs/msg/RegionOfInterest"](
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        return self._types["sensor_msgs/msg/CameraInfo"](
            header=self._header(part),
            height=camera.height,
            width=camera.width,
            distortion_model=_MODELS[camera.distortion.model] if camera.distortion else "plumb_bob",
            d=np.array(camera.distortion.coefficients if camera.distortion else (0.0,) * 5),
            k=camera.P[:, :3].reshape(-1).astype(np.float64),
            r=np.eye(3).reshape(-1),
            p=camera.P.reshape(-1).astype(np.float64),
            binning_x=0,
            binning_y=0,
            roi=region,
        )

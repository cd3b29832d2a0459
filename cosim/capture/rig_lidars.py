"""Scan with the LiDARs of a rig and encode the scans as files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cosim.capture.placed_rig import PlacedRig
from cosim.capture.rig_sensors import folder_of, measuring_rng
from cosim.drives.kitti.calibration import format_calibration
from cosim.drives.kitti.points import encode_points
from cosim.drives.kitti.rays import PointRays, encode_rays
from cosim.drives.twin import Ego, Lidar
from sensors.camera_view import CameraView
from sensors.hits import Hits
from sensors.hits_file import encode_hits
from sensors.motion import EgoMotion
from sensors.point_cloud import PointCloud
from sensors.scene import Instances, Scene
from sensors.sensor_model import SensorModel
from sensors.tracing import Tracer


@dataclass(frozen=True, eq=False)
class LidarScan:
    """Traced hits and measured point cloud of one LiDAR in one frame."""

    hits: Hits
    cloud: PointCloud


class RigLidars:
    """All LiDARs of a rig.

    Args:
        rig: poses and calibrations of the LiDARs.
        sensors: sensor models by LiDAR name.
        seed: seed of the run.
    """

    def __init__(self, rig: PlacedRig, sensors: Mapping[str, SensorModel], seed: int) -> None:
        self._rig, self._sensors, self._seed = rig, sensors, seed
        self._tracers = {
            name: Tracer(sensor.pattern.rays(), sensor.pattern.range_m) for name, sensor in sensors.items()
        }

    def scan(
        self,
        frame: str,
        scene: Scene,
        lidar_pose_ego: np.ndarray,
        instances: Instances,
        ego: Ego,
        view: CameraView | None,
        time_s: float,
    ) -> dict[str, LidarScan]:
        """Scan one instant with every LiDAR.

        Args:
            frame: name of the frame.
            scene: scene to trace.
            lidar_pose_ego: (4, 4) pose of the first LiDAR in the ego frame.
            instances: movable objects.
            ego: pose and motion of the ego vehicle.
            view: camera view used by effects; None if no effect needs one.
            time_s: pose time of the frame, as in the twin [s].

        Returns:
            Scans by LiDAR name.
        """
        motion = EgoMotion(ego.pose, ego.velocity_mps, ego.yaw_rate_radps, ego.acceleration_mps2)
        scans = {}
        for name, sensor in self._sensors.items():
            pose = ego.pose @ self._pose(name, lidar_pose_ego)
            hits = self._tracers[name].trace(scene, pose, instances)
            rng = measuring_rng(self._seed, frame, self._suffix(name))
            if sensor.needs_new_rays:
                cloud = sensor.trace_and_measure(scene, pose, instances, motion, rng, view, time_s)
            else:
                cloud = sensor.measure(hits, rng, view, time_s)
            scans[name] = LidarScan(hits, cloud)
        return scans

    def returns(self, scans: Mapping[str, LidarScan], instances: int) -> np.ndarray:
        """Count the beams of all LiDARs that hit each instance, (n,)."""
        counts = np.zeros(instances, np.int64)
        for scan in scans.values():
            instance = scan.hits.solid.instance
            counts += np.bincount(instance[instance >= 0], minlength=instances)
        return counts

    def files(self, frame: str, scans: Mapping[str, LidarScan]) -> dict[str, bytes]:
        """Encode points, rays and calibrations of a frame; returns file contents by path."""
        files = {}
        for name, scan in scans.items():
            folder, cloud = folder_of(self._suffix(name)), scan.cloud.in_file_order()
            files[f"{folder}velodyne/{frame}.bin"] = encode_points(cloud.kitti)
            rays = PointRays(cloud.ring, cloud.azimuth, cloud.time_s, cloud.return_no)
            files[f"{folder}rays/{frame}.npz"] = encode_rays(rays)
            files[f"{folder}calib/{frame}.txt"] = format_calibration(self._rig.calibrations[name]).encode()
        return files

    def hit_files(self, frame: str, scans: Mapping[str, LidarScan]) -> dict[str, bytes]:
        """Encode the traced hits of a frame; returns file contents by path."""
        return {
            f"{folder_of(self._suffix(name))}hits/{frame}.npz": encode_hits(scan.hits) for name, scan in scans.items()
        }

    def twins(self, lidar_pose_ego: np.ndarray, *, named: bool) -> dict[str, Lidar]:
        """The LiDARs as the twin stores them, by name; the first one's name is stored only if `named`."""
        first = self._sensors[self._rig.first].pattern
        return {
            name: Lidar(
                self._pose(name, lidar_pose_ego),
                sensor.pattern.name,
                sensor.pattern.sweep_s if sensor.pattern.sweep_s != first.sweep_s else None,
                name if named else "",
            )
            for name, sensor in self._sensors.items()
        }

    def _pose(self, name: str, lidar_pose_ego: np.ndarray) -> np.ndarray:
        return lidar_pose_ego if name == self._rig.first else lidar_pose_ego @ self._rig.lidars[name]

    def _suffix(self, name: str) -> str:
        """Name of a LiDAR within a drive; empty for the first LiDAR."""
        return "" if name == self._rig.first else name

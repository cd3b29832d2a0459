"""The LiDARs of a rig: what they measure, and the files of that."""

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
class Scan:
    """What a LiDAR met and measured in one frame."""

    hits: Hits
    cloud: PointCloud


class RigLidars:
    """Scans with all LiDARs of a rig.

    Args:
        rig: where they are.
        sensors: what they are, by name.
        seed: of the run.
    """

    def __init__(self, rig: PlacedRig, sensors: Mapping[str, SensorModel], seed: int) -> None:
        self._rig, self._sensors, self._seed = rig, sensors, seed
        self._tracers = {name: Tracer(one.pattern.rays(), one.pattern.range_m) for name, one in sensors.items()}

    def scan(
        self,
        frame: str,
        scene: Scene,
        lidar_pose_ego: np.ndarray,
        instances: Instances,
        ego: Ego,
        view: CameraView | None,
        time_s: float,
    ) -> dict[str, Scan]:
        """Scans of one instant, by LiDAR; `lidar_pose_ego` (4, 4) is that of the first, `time_s` as the twin has it."""
        motion = EgoMotion(ego.pose, ego.velocity_mps, ego.yaw_rate_radps, ego.acceleration_mps2)
        found = {}
        for name, sensor in self._sensors.items():
            pose = ego.pose @ self._pose(name, lidar_pose_ego)
            hits = self._tracers[name].trace(scene, pose, instances)
            rng = measuring_rng(self._seed, frame, self._suffix(name))
            if sensor.needs_new_rays:
                cloud = sensor.trace_and_measure(scene, pose, instances, motion, rng, view, time_s)
            else:
                cloud = sensor.measure(hits, rng, view, time_s)
            found[name] = Scan(hits, cloud)
        return found

    def returns(self, scans: Mapping[str, Scan], instances: int) -> np.ndarray:
        """How many beams of all LiDARs meet each instance, (n,)."""
        counts = np.zeros(instances, np.int64)
        for scan in scans.values():
            met = scan.hits.solid.instance
            counts += np.bincount(met[met >= 0], minlength=instances)
        return counts

    def files(self, frame: str, scans: Mapping[str, Scan]) -> dict[str, bytes]:
        """Files of a frame that hold points, beams and calibration, by path."""
        files = {}
        for name, scan in scans.items():
            folder, cloud = folder_of(self._suffix(name)), scan.cloud.in_file_order()
            files[f"{folder}velodyne/{frame}.bin"] = encode_points(cloud.kitti)
            rays = PointRays(cloud.ring, cloud.azimuth, cloud.time_s, cloud.return_no)
            files[f"{folder}rays/{frame}.npz"] = encode_rays(rays)
            files[f"{folder}calib/{frame}.txt"] = format_calibration(self._rig.calibrations[name]).encode()
        return files

    def hit_files(self, frame: str, scans: Mapping[str, Scan]) -> dict[str, bytes]:
        """Files of a frame that hold what every beam met, by path."""
        return {
            f"{folder_of(self._suffix(name))}hits/{frame}.npz": encode_hits(scan.hits) for name, scan in scans.items()
        }

    def twins(self, lidar_pose_ego: np.ndarray, *, named: bool) -> dict[str, Lidar]:
        """What the twin says of them, by name; `named` rigs tell the first one's name, too."""
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
        """A LiDAR's name in a drive, where the first has none."""
        return "" if name == self._rig.first else name

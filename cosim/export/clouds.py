"""Scans as PCD and LAS files, a file a frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Drive
from cosim.export.source import WorldPoses, needed

_LAS_STEP_M = 0.001


def export_pcd(drive: Drive, folder: Path, on_frame: Callable[[], None]) -> dict[str, int]:
    """Write `NAME.pcd`: x y z intensity ring azimuth time return_no, LiDAR axes, binary.

    PCL's format 0.7 (pointclouds.org, The PCD file format).
    """
    pypcd4 = needed("pypcd4")
    fields = ("x", "y", "z", "intensity", "ring", "azimuth", "time", "return_no")
    types = (*(np.float32,) * 4, np.uint16, np.float32, np.float32, np.uint8)
    for frame in drive:
        rays = frame.rays
        columns = [*frame.points.T, rays.ring, rays.azimuth, rays.time_s, rays.return_no]
        cloud = pypcd4.PointCloud.from_points(columns, fields, types)
        cloud.save(folder / f"{frame.name}.pcd")
        on_frame()
    return {"frames": len(drive)}


def export_las(drive: Drive, folder: Path, on_frame: Callable[[], None]) -> dict[str, int]:
    """Write `NAME.las`, version 1.4: world coordinates if the twin has poses, LiDAR axes otherwise.

    Intensity is 16 bit, return numbers count from 1, and `gps_time` is the firing time; ring and azimuth are extra
    dimensions. ASPRS, LAS Specification 1.4-R15, point format 6.
    """
    laspy, world = needed("laspy"), WorldPoses(drive)
    for frame in drive:
        xyz = frame.points[:, :3].astype(np.float64)
        start_s = 0.0
        if frame.has("twin/frames"):
            pose = world.of(frame, frame.twin.ego.pose @ frame.twin.lidar.pose_ego)
            xyz, start_s = xyz @ pose[:3, :3].T + pose[:3, 3], frame.twin.time_s
        header = laspy.LasHeader(point_format=6, version="1.4")
        header.scales = np.full(3, _LAS_STEP_M)
        header.offsets = np.floor(xyz.min(0)) if len(xyz) else np.zeros(3)
        header.add_extra_dim(laspy.ExtraBytesParams("ring", np.uint16, "laser, 0 on top"))
        header.add_extra_dim(laspy.ExtraBytesParams("azimuth", np.float32, "nominal beam azimuth rad"))
        las, rays = laspy.LasData(header), frame.rays
        las.x, las.y, las.z = xyz.T
        las.intensity = np.rint(np.clip(frame.points[:, 3], 0, 1) * 65535).astype(np.uint16)
        las.gps_time = start_s + rays.time_s.astype(np.float64)
        las.return_number = np.minimum(rays.return_no + 1, 15)
        las.number_of_returns = _returns_of_beam(rays.ring, rays.time_s)
        las.ring, las.azimuth = rays.ring.astype(np.uint16), rays.azimuth
        las.write(str(folder / f"{frame.name}.las"))
        on_frame()
    return {"frames": len(drive)}


def _returns_of_beam(ring: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """(n,) uint8 number of returns of each point's beam."""
    beams = np.stack([ring.astype(np.float64), time_s.astype(np.float64)], 1)
    _, which, count = np.unique(beams, axis=0, return_inverse=True, return_counts=True)
    return np.minimum(count[which.reshape(-1)], 15).astype(np.uint8)

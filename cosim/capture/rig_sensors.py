"""The sensor of every LiDAR of a rig, and where its scans lie in a drive."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np

from cosim.capture.config import RunConfig
from cosim.drives.kitti.layout import LIDARS
from sensors.sensor_model import SensorModel, load_sensor


def rig_sensors(config: RunConfig) -> dict[str, SensorModel]:
    """By LiDAR, the first one first.

    Raises:
        SensorError: a sensor does not exist or breaks the format.
    """
    return {one.name: load_sensor(one.sensor or config.sensor) for one in config.rig_used.lidars}


def beams_of(sensors: Sequence[SensorModel]) -> int:
    """How many beams they fire in a frame."""
    return sum(len(sensor.pattern.rays()) for sensor in sensors)


def folder_of(lidar: str) -> str:
    """What paths of a LiDAR's files begin with; the empty name is that of a drive's first."""
    return f"{LIDARS}/{lidar}/" if lidar else ""


def measuring_rng(seed: int, frame: str, lidar: str = "") -> np.random.Generator:
    """The generator with which a LiDAR measures a frame; the empty name is that of a drive's first."""
    number = int(frame) if frame.isdigit() else zlib.crc32(frame.encode())
    return np.random.default_rng([seed, number, *([zlib.crc32(lidar.encode())] if lidar else [])])

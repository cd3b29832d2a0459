"""Sensor models of the LiDARs of a rig, and the folders of their scans in a drive."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np

from cosim.capture.config import RunConfig
from cosim.drives.kitti.layout import LIDARS
from sensors.sensor_file import read_annotator
from sensors.sensor_model import SensorModel, load_sensor


def rig_sensors(config: RunConfig) -> dict[str, SensorModel]:
    """Load the sensor model of every LiDAR of the rig, in the rig's order; labels belong to the first.

    Raises:
        SensorError: a sensor file or the annotator's file does not exist or is invalid.
    """
    lidars = config.rig_used.lidars
    sensors = {lidar.name: load_sensor(lidar.sensor or config.sensor) for lidar in lidars}
    first = lidars[0].name
    labelled = sensors[first]
    sensors[first] = labelled.with_annotator(read_annotator(config.labels.annotator, labelled.pattern))
    return sensors


def beams_of(sensors: Sequence[SensorModel]) -> int:
    """Number of beams that the sensors fire in a frame."""
    return sum(len(sensor.pattern.rays()) for sensor in sensors)


def folder_of(lidar: str) -> str:
    """Path prefix of a LiDAR's files; the name of a drive's first LiDAR is empty."""
    return f"{LIDARS}/{lidar}/" if lidar else ""


def measuring_rng(seed: int, frame: str, lidar: str = "") -> np.random.Generator:
    """Random generator for the measurement of a frame by a LiDAR; the name of a drive's first LiDAR is empty."""
    number = int(frame) if frame.isdigit() else zlib.crc32(frame.encode())
    return np.random.default_rng([seed, number, *([zlib.crc32(lidar.encode())] if lidar else [])])

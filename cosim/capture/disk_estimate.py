"""Estimate the disk space of a run before it starts."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from cosim.capture.config import RunConfig
from cosim.capture.plan import plan_episodes, world_count
from cosim.capture.products import camera_of, kind_of
from cosim.capture.rig_sensors import beams_of
from cosim.errors import CosimError
from sensors.sensor_model import SensorModel

# Bytes per beam, pixel, frame or world, measured on drives in all towns.
_POINT = 16 * 0.95  # 95 % of the beams return
_RAY = 0.6
_HIT = 1.0
_PIXEL = {"gray": 0.15, "image": 0.36, "depth": 0.5, "semantic": 0.02, "instance": 0.03}
_TEXT = 250_000  # poses, labels, calibration
_WORLD = 13_000_000
_MODELS = 3_500_000


class DiskError(CosimError):
    """A run needs more disk space than is free."""


def estimate_bytes(config: RunConfig, sensors: Sequence[SensorModel]) -> int:
    """Estimate the disk space of a run with these LiDARs, accurate to 20 % [bytes]."""
    frame = beams_of(sensors) * (_POINT + _RAY + (_HIT if config.store_hits else 0)) + _TEXT
    cameras = {camera.name: camera for camera in config.rig_used.cameras}
    for product in config.images:
        camera, kind = cameras[camera_of(product)], kind_of(product)
        gray = kind == "image" and camera.kind == "gray"
        frame += camera.width_px * camera.height_px * _PIXEL["gray" if gray else kind]
    worlds = world_count(plan_episodes(config))
    return round(config.frames * frame + worlds * _WORLD + _MODELS)


def check_disk_space(needed: int, folder: Path) -> None:
    """Check that the disk has enough free space.

    Raises:
        DiskError: less than `needed` bytes are free.
    """
    disk = shutil.disk_usage(_existing(folder))
    if disk.total and needed > disk.free:  # file systems without a size report 0
        raise DiskError(
            f"the run needs about {in_words(needed)}, {folder} has {in_words(disk.free)} free; record fewer frames, "
            "leave out images or set store_hits: false, or choose another --out"
        )


def in_words(count: float) -> str:
    """Format a number of bytes with a decimal prefix."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def _existing(folder: Path) -> Path:
    """The folder itself, or its nearest ancestor that exists."""
    folder = folder.absolute()
    while not os.path.lexists(folder):
        folder = folder.parent
    return folder

"""How much disk a run will take, told before it begins."""

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

# Measured on drives of all towns: bytes a beam, a pixel, a frame, a world.
_POINT = 16 * 0.95  # of beams that return
_RAY = 0.6
_HIT = 1.0
_PIXEL = {"gray": 0.15, "image": 0.36, "depth": 0.5, "semantic": 0.02, "instance": 0.03}
_TEXT = 250_000  # poses, labels, calibration
_WORLD = 13_000_000
_MODELS = 3_500_000


class DiskError(CosimError):
    """A run needs more disk than there is."""


def estimate_bytes(config: RunConfig, sensors: Sequence[SensorModel]) -> int:
    """Disk that a run with these LiDARs takes, to within a fifth [bytes]."""
    frame = beams_of(sensors) * (_POINT + _RAY + (_HIT if config.store_hits else 0)) + _TEXT
    cameras = {camera.name: camera for camera in config.rig_used.cameras}
    for product in config.images:
        camera, kind = cameras[camera_of(product)], kind_of(product)
        gray = kind == "image" and camera.kind == "gray"
        frame += camera.width_px * camera.height_px * _PIXEL["gray" if gray else kind]
    worlds = world_count(plan_episodes(config))
    return round(config.frames * frame + worlds * _WORLD + _MODELS)


def demand_space(needed: int, folder: Path) -> None:
    """Refuse to begin what the disk cannot hold.

    Raises:
        DiskError: less is free than `needed`.
    """
    disk = shutil.disk_usage(_existing(folder))
    if disk.total and needed > disk.free:  # file systems without a size say 0
        raise DiskError(
            f"the run needs about {in_words(needed)}, {folder} has {in_words(disk.free)} free; ask for fewer frames, "
            "leave out images or set store_hits: false, or choose another --out"
        )


def in_words(count: float) -> str:
    """A number of bytes as people say it."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def _existing(folder: Path) -> Path:
    """The nearest folder above that exists."""
    folder = folder.absolute()
    while not os.path.lexists(folder):
        folder = folder.parent
    return folder

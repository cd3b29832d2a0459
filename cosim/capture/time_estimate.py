"""Estimate how long a run takes before it starts."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Sequence

import numpy as np

from cosim.capture.camera_views import effect_camera
from cosim.capture.config import RunConfig
from cosim.capture.plan import plan_episodes, world_count
from cosim.capture.products import camera_of, cameras_of
from cosim.capture.rig_sensors import beams_of
from sensors.sensor_model import SensorModel

# Processor time [s], measured on drives in all towns on a machine that needs _PROBE_S for the probe below.
_PROCESS = 2.2  # per process: imports, models, shaders
_TOWN = 0.8  # per process and town: streets and groundwork
_WORLD = 3.0  # per world: geometry, objects and light
_EPISODE = 0.8  # per episode: population, warm-up, lead-in
_STEP = 0.007  # per simulation step, with vehicle bodies and behaviour near the ego vehicle
_STEPS = 2.0  # steps between two frames, relative to the minimum: red lights and empty roads
_FRAME = 0.06  # per frame: poses, labels, text, checksums
_CAMERA = 0.05
_IMAGE = 0.006
_BEAM = 0.55e-6
_HIT = 0.08e-6
_PROBE_S = 0.037
_KITTI_PX = 1242 * 375  # pixels of a KITTI image


def estimate_s(config: RunConfig, sensors: Sequence[SensorModel], workers: int, slowness: float = 1.0) -> float:
    """Estimate the wall-clock time of a run, accurate to about 20 % on an otherwise idle machine [s].

    Args:
        config: configuration of the run.
        sensors: sensor models of the LiDARs.
        workers: number of worker processes; more than processors or episodes have no effect.
        slowness: slowness of this machine from `machine_slowness`.
    """
    plans = plan_episodes(config)
    busy = max(1, min(workers, os.cpu_count() or 1, len(plans)))
    beams, rig = beams_of(sensors), config.rig_used
    products = [*config.images, f"instance_{rig.reference.name}"]
    if any(sensor.needs_camera for sensor in sensors):
        products.append(f"image_{effect_camera([camera.name for camera in rig.cameras], rig.reference.name)}")
    sizes = {camera.name: camera.width_px * camera.height_px / _KITTI_PX for camera in rig.cameras}
    cameras = sum(sizes[name] for name in cameras_of(products))
    images = sum(sizes[camera_of(product)] for product in config.images)
    steps = _STEPS * max(1.0, config.collection.every_s / config.step_s)
    frame = _FRAME + steps * _STEP + cameras * _CAMERA + images * _IMAGE
    frame += beams * (_BEAM + (_HIT if config.store_hits else 0.0))
    towns = math.ceil(len(config.towns) / busy) * busy  # each process stays in its towns
    setup = busy * _PROCESS + max(towns, busy) * _TOWN + max(world_count(plans), busy) * _WORLD + len(plans) * _EPISODE
    return slowness * (setup + config.frames * frame) / busy


def machine_slowness() -> float:
    """Duration of a short benchmark on this machine, divided by its duration on the reference machine."""
    rng, start_s = np.random.default_rng(0), time.perf_counter()
    for _ in range(10):
        values = rng.random(50_000)
        np.sort(values)
        texts = {number: str(number) for number in range(10_000)}
        sum(len(texts[number]) for number in range(10_000))
    return (time.perf_counter() - start_s) / _PROBE_S


def time_in_words(seconds: float) -> str:
    """Format a duration in seconds, minutes or hours."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 90 * 60:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"

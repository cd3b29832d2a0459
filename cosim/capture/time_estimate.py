"""Estimate how long a run takes before it starts."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from assets.streets import Streets
from cosim.capture.camera_views import effect_camera
from cosim.capture.config import RunConfig
from cosim.capture.plan import EpisodePlan, plan_episodes, world_count
from cosim.capture.products import camera_of, cameras_of
from cosim.capture.rig_sensors import beams_of
from cosim.scene.surroundings import BUILT_M, LARGE_M, lane_length_m
from sensors.sensor_model import SensorModel

# Processor time [s], measured on drives in all towns on a machine that needs _PROBE_S for the probe below.
_PROCESS = 2.2  # per process: imports, models, shaders
_TOWN = 0.8  # per process and town: streets and groundwork of a built-in town
_WORLD = 3.0  # per world of a built-in town: geometry, objects and light
_READ_LANE = 0.23e-3  # per lane of a scenario's network, in the first process and in each worker
_START_LANE = 0.16e-3  # per lane and simulation of a scenario
_BUILD_KM = 0.40  # per world and km of lanes of a scenario: groundwork, geometry, objects and light
_EPISODE = 0.8  # per episode: population, warm-up, lead-in
_STEP = 0.007  # per simulation step, with vehicle bodies and behaviour near the ego vehicle
_STEPS = 2.0  # steps between two frames, relative to the minimum: red lights and empty roads
_FRAME = 0.06  # per frame: poses, labels, text, checksums
_CAMERA = 0.05
_IMAGE = 0.006
_BEAM = 0.55e-6
_HIT = 0.08e-6
_PROBE_S = 0.011
_EGO_MPS = 8.0
_KITTI_PX = 1242 * 375  # pixels of a KITTI image


@dataclass(frozen=True)
class TownSize:
    """Size of a user's network, on which the time of a run depends.

    Attributes:
        lanes: number of lanes.
        length_m: length of all lanes [m].
        extent_m: extent along x and y [m].
    """

    lanes: int
    length_m: float
    extent_m: tuple[float, float]

    @classmethod
    def of(cls, streets: Streets) -> TownSize:
        """Measure a network with at least one lane."""
        width, height = np.ptp(np.concatenate([lane.centre[:, :2] for lane in streets.lanes]), axis=0).tolist()
        return cls(len(streets.lanes), lane_length_m(streets), (width, height))

    def built_m(self, route_m: float) -> float:
        """Expected length of the lanes of which a world is built, for a route of a length [m]."""
        if self.length_m <= LARGE_M:
            return self.length_m
        width, height = (max(extent, BUILT_M) for extent in self.extent_m)
        built_m2 = np.pi * BUILT_M**2 + 2 * BUILT_M * route_m
        return min(1.0, built_m2 / (width * height)) * self.length_m


def estimate_s(
    config: RunConfig,
    sensors: Sequence[SensorModel],
    workers: int,
    slowness: float = 1.0,
    sizes: Mapping[str, TownSize] | None = None,
) -> float:
    """Estimate the wall-clock time of a run, accurate to about 20 % in built-in towns on an otherwise idle machine [s].

    In a user's scenario the time also depends on its traffic, which is not known before the simulation.

    Args:
        config: configuration of the run.
        sensors: sensor models of the LiDARs.
        workers: number of worker processes; more than processors or episodes have no effect.
        slowness: slowness of this machine from `machine_slowness`.
        sizes: sizes of the user's networks by the name of the town in the configuration.
    """
    plans = plan_episodes(config)
    busy = max(1, min(workers, os.cpu_count() or 1, len(plans)))
    beams, rig = beams_of(sensors), config.rig_used
    products = [*config.images, f"instance_{rig.reference.name}"]
    if any(sensor.needs_camera for sensor in sensors):
        products.append(f"image_{effect_camera([camera.name for camera in rig.cameras], rig.reference.name)}")
    sizes_px = {camera.name: camera.width_px * camera.height_px / _KITTI_PX for camera in rig.cameras}
    cameras = sum(sizes_px[name] for name in cameras_of(products))
    images = sum(sizes_px[camera_of(product)] for product in config.images)
    steps = _STEPS * max(1.0, config.collection.every_s / config.step_s)
    frame = _FRAME + steps * _STEP + cameras * _CAMERA + images * _IMAGE
    frame += beams * (_BEAM + (_HIT if config.store_hits else 0.0))
    towns = math.ceil(len(config.towns) / busy) * busy  # each process stays in its towns
    setup = busy * _PROCESS + max(towns, busy) * _TOWN + max(world_count(plans), busy) * _WORLD + len(plans) * _EPISODE
    setup += sum(_scenario_s(size, name, config, plans, busy) for name, size in (sizes or {}).items())
    return slowness * (setup + config.frames * frame) / busy


def _scenario_s(size: TownSize, name: str, config: RunConfig, plans: Sequence[EpisodePlan], busy: int) -> float:
    """Time that a user's network takes in addition to a built-in town [s]."""
    episodes = [plan for plan in plans if plan.town == name]
    if not episodes:
        return 0.0
    is_large = size.length_m > LARGE_M
    worlds = len(episodes) if is_large else len({plan.world for plan in episodes})
    route_m = _EGO_MPS * config.collection.every_s * len(episodes[0].frames)
    read = (busy + busy) * size.lanes * _READ_LANE  # the first process reads while the workers wait
    build = 0.0 if config.world is not None else worlds * size.built_m(route_m) / 1000 * _BUILD_KM
    if config.trajectories is not None:
        return read + build
    return read + build + len(episodes) * (size.lanes * _START_LANE + config.warm_up_s / config.step_s * _STEP)


def machine_slowness() -> float:
    """Duration of a short benchmark on this machine, divided by its duration on the reference machine."""
    rng, start_s = np.random.default_rng(0), time.perf_counter()
    for _ in range(3):
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

"""Simulate the frames of a drive again with several sensor models, for example without one effect each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cosim.capture.camera_views import view_of_frame
from cosim.capture.rig_sensors import measuring_rng
from cosim.drives.kitti import Drive, Frame
from cosim.drives.twin.scene import TwinScenes, ego_motion, lidar_pose, scene_instances
from sensors.effects.base import Effect, LabelEffect
from sensors.sensor_model import SensorModel, points_of
from sensors.shot import Shot


def without(sensor: SensorModel, effect: str, given: SensorModel | None = None) -> SensorModel:
    """Remove an effect from a model; if the baseline `given` has an effect of that name, use it instead."""
    baseline = [item for item in given.effects if item.name == effect] if given is not None else []
    kept = tuple(item for item in sensor.effects if item.name != effect)
    return replace(sensor, effects=(*kept, *baseline))


def rescans(
    drive: Drive, names: Sequence[str], sensors: Sequence[SensorModel]
) -> Iterator[tuple[Frame, list[np.ndarray]]]:
    """Simulate frames of a drive with several sensor models.

    Args:
        drive: drive with a twin.
        names: names of the frames.
        sensors: sensor models with the same pattern; models with equal beam effects share the traced rays.

    Yields:
        A frame, and the points (n, 4) float32 of each sensor model.

    Raises:
        CosimError: a part of the twin does not exist or is damaged.
        SensorError: a user-defined effect returns invalid results.
    """
    scenes, seed = TwinScenes(drive), int(drive.info.get("seed", 0))
    for name in names:
        frame = drive[name]
        shots: dict[tuple[str, ...], Shot] = {}
        scans = []
        for sensor in sensors:
            rng = measuring_rng(seed, name, drive.lidar)
            key = tuple(_effect_key(effect) for effect in sensor.beam_effects)
            if key not in shots:
                twin = frame.twin
                instances, ego = scene_instances(twin.instances), ego_motion(twin)
                trace_rng, pose = measuring_rng(seed, name, drive.lidar), lidar_pose(twin)
                camera = view_of_frame(frame, frame.calibration, pose)
                shots[key] = sensor.trace(scenes.of(frame), pose, instances, ego, trace_rng, camera, twin.time_s)
            scans.append(points_of(sensor.returns_of(shots[key], rng), shots[key]).kitti)
        yield frame, scans


def scan_effects(sensor: SensorModel) -> tuple[str, ...]:
    """Names of the effects that change scans, which are all except label effects."""
    return tuple(dict.fromkeys(effect.name for effect in sensor.effects if not isinstance(effect, LabelEffect)))


def _effect_key(effect: Effect) -> str:
    return f"{effect.source or effect.name} {effect.model_dump_json()}"

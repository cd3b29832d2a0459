"""Frames of a drive measured again by some sensors, and by these without one of their effects."""

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
    """The model without an effect; with the one of that name that `given` has, where it had one before."""
    before = [one for one in given.effects if one.name == effect] if given is not None else []
    kept = tuple(one for one in sensor.effects if one.name != effect)
    return replace(sensor, effects=(*kept, *before))


def rescans(
    drive: Drive, names: Sequence[str], sensors: Sequence[SensorModel]
) -> Iterator[tuple[Frame, list[np.ndarray]]]:
    """Frames of a drive with what some sensors measure of their twins.

    Args:
        drive: with a twin.
        names: of the frames.
        sensors: of one pattern; those that bend beams alike answer from one revolution.

    Yields:
        A frame, and its points (n, 4) float32 as each sensor measures them.

    Raises:
        CosimError: a part of the twin is absent or broken.
        SensorError: an effect of a user's own breaks the rules.
    """
    scenes, seed = TwinScenes(drive), int(drive.info.get("seed", 0))
    for name in names:
        frame = drive[name]
        shots: dict[tuple[str, ...], Shot] = {}
        scans = []
        for sensor in sensors:
            rng = measuring_rng(seed, name, drive.lidar)
            key = tuple(_told(effect) for effect in sensor.beam_effects)
            if key not in shots:
                twin = frame.twin
                things, ego = scene_instances(twin.instances), ego_motion(twin)
                own, pose = measuring_rng(seed, name, drive.lidar), lidar_pose(twin)
                camera = view_of_frame(frame, frame.calibration, pose)
                shots[key] = sensor.trace(scenes.of(frame), pose, things, ego, own, camera, twin.time_s)
            scans.append(points_of(sensor.answer(shots[key], rng), shots[key]).kitti)
        yield frame, scans


def that_count(sensor: SensorModel) -> tuple[str, ...]:
    """Names of the effects that change scans: not those of labels."""
    return tuple(dict.fromkeys(one.name for one in sensor.effects if not isinstance(one, LabelEffect)))


def _told(effect: Effect) -> str:
    return f"{effect.source or effect.name} {effect.model_dump_json()}"

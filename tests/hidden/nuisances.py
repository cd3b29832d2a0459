"""What is wrong with the twin that comes with a measured drive: labels, map and poses are never exact.

`usual` is what half of all cases have: poses, objects and paints a little off. `harder` is half as much again, and a
fifth of the tall objects is displaced from the map. The others are single faults, for separate nulls.
"""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np

from tests.hidden.glb_edit import move_vertices
from tests.hidden.head import rotation

NUISANCES = ("label_jitter_track", "label_jitter_frame", "map_error", "pose_drift", "usual", "harder")
_LABEL_M, _LABEL_DEG = 0.04, 0.5
_MAP_M, _MAP_WAVES = 0.015, 16
_DRIFT_M, _DRIFT_DEG = 0.015, 0.03
_FACTORS = {"usual": 1.0, "harder": 1.5}
_SCAN_M, _SCAN_DEG = 0.01, 0.02  # each scan, each axis
_OBJECT_M, _OBJECT_DEG, _CONSTANT = 0.02, 0.3, 0.9  # each object, each axis; share of the variance that its track keeps
_PAINT = 0.05  # of an object's reflectance


def written_frames(frames: list[dict], names: tuple[str, ...], rng: np.random.Generator) -> list[dict]:
    """The poses that are written, from those that are true."""
    frames = copy.deepcopy(frames)
    if "label_jitter_track" in names:
        things = sorted({thing["id"] for frame in frames for thing in frame["instances"]})
        error = {thing: _label_error(rng) for thing in things}
        _move_labels(frames, lambda thing: error[thing["id"]])
    if "label_jitter_frame" in names:
        _move_labels(frames, lambda thing: _label_error(rng))
    if "pose_drift" in names:
        _drift(frames, rng)
    for name, factor in _FACTORS.items():
        if name in names:
            _spoil(frames, factor, rng)
    return frames


def _spoil(frames: list[dict], factor: float, rng: np.random.Generator) -> None:
    """Errors of scan poses, object positions and paints, independent of each other."""
    tracks: dict[str, np.ndarray] = {}
    paints: dict[str, float] = {}
    for frame in frames:
        position, turn = factor * _SCAN_M * rng.normal(size=3), factor * _SCAN_DEG * rng.normal(size=3)
        frame["ego"]["pose"] = _rounded(np.array(frame["ego"]["pose"], float) @ _moved(position, turn))
        for thing in frame["instances"]:
            kept = tracks.setdefault(thing["id"], rng.normal(size=4))
            x, y, z, yaw = factor * (_CONSTANT**0.5 * kept + (1 - _CONSTANT) ** 0.5 * rng.normal(size=4))
            error = _moved(_OBJECT_M * np.array([x, y, z]), np.array([0, 0, _OBJECT_DEG * yaw]))
            thing["pose"] = _rounded(np.array(thing["pose"], float) @ error)
            gain = paints.setdefault(thing["id"], 1 + factor * _PAINT * float(rng.normal()))
            thing["paint"] = round(float(np.clip(thing["paint"] * gain, 0.01, 1)), 4)


def _moved(place_m: np.ndarray, turn_deg: np.ndarray) -> np.ndarray:
    error = rotation(*np.radians(turn_deg))
    error[:3, 3] = place_m
    return error


def _label_error(rng: np.random.Generator) -> np.ndarray:
    error = rotation(yaw=np.radians(rng.normal(0, _LABEL_DEG)))
    error[:2, 3] = rng.normal(0, _LABEL_M, 2)
    error[2, 3] = rng.normal(0, _LABEL_M / 4)
    return error


def _move_labels(frames: list[dict], error_of) -> None:
    for frame in frames:
        for thing in frame["instances"]:
            thing["pose"] = _rounded(np.array(thing["pose"], float) @ error_of(thing))


def _drift(frames: list[dict], rng: np.random.Generator) -> None:
    """A random walk that has wandered `_DRIFT_M` and `_DRIFT_DEG` on average over the drive."""
    steps = rng.normal(size=(len(frames), 6)).cumsum(0)
    steps *= np.sqrt(2 / len(frames))
    for frame, (x, y, z, roll, pitch, yaw) in zip(frames, steps, strict=True):
        error = rotation(*np.radians(_DRIFT_DEG) * np.array([roll, pitch, yaw]))
        pose = np.array(frame["ego"]["pose"], float) @ error
        pose[:3, 3] += _DRIFT_M * np.array([x, y, z])  # satellites err in world axes, gyroscopes in the car's
        frame["ego"]["pose"] = _rounded(pose)


def _rounded(pose: np.ndarray) -> list[list[float]]:
    return np.round(pose, 9).tolist()


def warp_map(source: Path, target: Path, rng: np.random.Generator) -> None:
    """Copy a `.glb` with its vertices moved smoothly by some centimetres, wave lengths 10–60 m."""
    wave = rng.normal(size=(_MAP_WAVES, 3)) / rng.uniform(10, 60, (_MAP_WAVES, 1)) * 2 * np.pi
    phase = rng.uniform(0, 2 * np.pi, _MAP_WAVES)
    push = rng.normal(size=(_MAP_WAVES, 3)) * _MAP_M * np.sqrt(2 / _MAP_WAVES)
    move_vertices(source, target, lambda points: np.cos(points @ wave.T + phase) @ push)

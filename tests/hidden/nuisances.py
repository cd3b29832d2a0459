"""What is wrong with the twin that comes with a measured drive: labels, map and poses are never exact."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np

from tests.hidden.glb_edit import move_vertices
from tests.hidden.head import rotation

NUISANCES = ("label_jitter_track", "label_jitter_frame", "map_error", "pose_drift")
_LABEL_M, _LABEL_DEG = 0.04, 0.5
_MAP_M, _MAP_WAVES = 0.015, 16
_DRIFT_M, _DRIFT_DEG = 0.015, 0.03


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
    return frames


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

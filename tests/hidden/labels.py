"""Labels of a drive made smaller, as annotators would who follow the points; own arithmetic on KITTI's text."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np

_LIFT_M = 0.05


def shrink_labels(
    drive: Path, out: Path, a: tuple[float, ...], b: tuple[float, ...], jitter_m: float, seed: int
) -> None:
    """Copy a drive with each edge of a vehicle's label less by a + b·(edge − extent of points), and jittered.

    Sides keep their middle where nothing was seen of either; the jitter is an annotator's, the same for an object in
    all frames.
    """
    shutil.copytree(drive, out, symlinks=True)
    rng = np.random.default_rng(seed)
    moods: dict[str, np.ndarray] = {}
    for path in sorted((out / "label_2").glob("*.txt")):
        twin = json.loads((drive / "twin/frames" / f"{path.stem}.json").read_text())
        points = np.fromfile(drive / "velodyne" / f"{path.stem}.bin", np.float32).reshape(-1, 4)[:, :3].astype(float)
        world = np.array(twin["ego"]["pose"]) @ np.array(twin["lidar"]["pose_ego"])
        placed = points @ world[:3, :3].T + world[:3, 3]
        to_camera = _to_camera(drive / "calib" / path.name) @ np.linalg.inv(world)
        lines = [
            _shrunk(line, twin, placed, to_camera, a, b, jitter_m, moods, rng) for line in path.read_text().splitlines()
        ]
        path.write_text("".join(f"{line}\n" for line in lines))


def _shrunk(line, twin, points, to_camera, a, b, jitter_m, moods, rng) -> str:
    words = line.split()
    if words[0] not in ("Car", "Van", "Truck"):
        return line
    position = np.array([float(v) for v in words[11:14]])
    best = min(twin["instances"], key=lambda one: np.hypot(*(_bottom(one, to_camera) - position)[[0, 2]]))
    if np.hypot(*(_bottom(best, to_camera) - position)[[0, 2]]) > 0.3:
        return line
    pose, size = np.array(best["pose"]), np.array([best["length_m"], best["width_m"], best["height_m"]])
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    inside = (np.abs(local[:, :2]) <= size[:2] / 2).all(1) & (local[:, 2] > _LIFT_M) & (local[:, 2] < size[2] + 0.02)
    if inside.sum() < 5:
        return line
    low, high = local[inside].min(0), local[inside].max(0)
    mood = moods.setdefault(best["id"], rng.normal(0, jitter_m, 3)) if jitter_m else np.zeros(3)
    loss = np.array(a) + np.array(b) * (size - (high - low)) + mood
    words[8:11] = [f"{value:.2f}" for value in (size - loss)[[2, 1, 0]]]
    words[12] = f"{position[1] - _LIFT_M:.2f}"
    return " ".join(words)


def _bottom(one: dict, to_camera: np.ndarray) -> np.ndarray:
    return to_camera[:3, :3] @ np.array(one["pose"])[:3, 3] + to_camera[:3, 3]


def _to_camera(path: Path) -> np.ndarray:
    rows = dict(line.split(":", 1) for line in path.read_text().splitlines() if ":" in line)
    rotation, shift = np.eye(4), np.eye(4)
    rotation[:3, :3] = np.array(rows["R0_rect"].split(), float).reshape(3, 3)
    shift[:3] = np.array(rows["Tr_velo_to_cam"].split(), float).reshape(3, 4)
    return rotation @ shift

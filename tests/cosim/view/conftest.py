"""A tiny drive in KITTI's format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.drives.kitti import Boxes, Calibration, Labels, encode_rgb, write_calibration, write_labels, write_points

CAR = Boxes(np.array([[12.0, 2.0, -0.9]]), np.array([[4.2, 1.8, 1.5]]), np.array([0.2]))


@pytest.fixture(scope="session")
def calibration() -> Calibration:
    """A camera at the LiDAR, axes square: x right = −y left, y down = −z up, z forward = x forward."""
    projection = np.array([[200.0, 0, 100, 0], [0, 200.0, 40, 0], [0, 0, 1, 0]])
    turn = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0]])
    return Calibration(P2=projection, R0_rect=np.eye(3), Tr_velo_to_cam=turn)


@pytest.fixture(scope="session")
def scan() -> np.ndarray:
    """Four rings of ground, in KITTI's order, and a wall of points within the car's box on top of it."""
    azimuth = np.linspace(0.001, 2 * np.pi - 0.001, 300)
    rings = [np.stack([r * np.cos(azimuth), r * np.sin(azimuth), np.full(300, -1.7)], -1) for r in (40, 20, 10, 5)]
    side = np.stack(np.meshgrid([11.0], np.linspace(1.5, 2.5, 12), np.linspace(-1.3, -0.5, 8)), -1).reshape(-1, 3)
    xyz = np.concatenate([*rings, side])
    return np.column_stack([xyz, np.linspace(0, 1, len(xyz))]).astype(np.float32)


@pytest.fixture
def bare_drive(tmp_path: Path, calibration: Calibration, scan: np.ndarray) -> Path:
    """Three frames with only points and calibration."""
    root = tmp_path / "drive"
    for part in ("velodyne", "calib"):
        (root / part).mkdir(parents=True)
    for name in ("000000", "000001", "000002"):
        write_points(root / "velodyne" / f"{name}.bin", scan)
        write_calibration(root / "calib" / f"{name}.txt", calibration)
    return root


@pytest.fixture
def labelled_drive(bare_drive: Path, calibration: Calibration) -> Path:
    """The same with images and a labelled car in frame 000001."""
    for part in ("label_2", "image_2"):
        (bare_drive / part).mkdir()
    labels = Labels.from_boxes(CAR, ["Car"], calibration, bbox=np.array([[40.0, 45, 80, 62]]))
    write_labels(bare_drive / "label_2" / "000001.txt", labels)
    for name in ("000000", "000001", "000002"):
        (bare_drive / "image_2" / f"{name}.png").write_bytes(encode_rgb(np.full((80, 200, 3), 90, np.uint8)))
    return bare_drive

"""A small simulated drive, written with the library."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from assets.mesh import Mesh
from cosim.drives.kitti import (
    Boxes,
    Calibration,
    Labels,
    Oxts,
    PointRays,
    encode_depth,
    encode_gray,
    encode_rgb,
    write_calibration,
    write_labels,
    write_oxts,
    write_points,
    write_rays,
)
from cosim.drives.kitti.frame import PARTS
from cosim.drives.twin import Ego, Lidar, TwinCamera, TwinFrame, write_frame, write_glb, write_materials

NAMES = ("000000", "000001", "000002")
CALIBRATION = Calibration(
    P2=np.array([[700, 0, 80, 0], [0, 700, 50, 0], [0, 0, 1, 0]], float),
    R0_rect=np.eye(3),
    Tr_velo_to_cam=np.array([[0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, -0.27]]),
)


@pytest.fixture
def drive_root(tmp_path: Path) -> Path:
    """Three frames with every part."""
    root = tmp_path / "drive"
    for part in (*PARTS, "ImageSets", "twin/models"):
        (root / part).mkdir(parents=True)
    for row, name in enumerate(NAMES):
        rng = np.random.default_rng(row)
        azimuth = np.linspace(3, -3, 50)
        points = np.stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), 0 * azimuth, rng.random(50)], -1)
        box = Boxes(np.array([[10.0, row, 0]]), np.array([[4, 1.7, 1.5]]), np.array([0.1 * row]))
        write_points(root / f"velodyne/{name}.bin", points)
        write_rays(root / f"rays/{name}.npz", PointRays(np.full(50, 7), azimuth, -azimuth, np.zeros(50)))
        write_calibration(root / f"calib/{name}.txt", CALIBRATION)
        write_labels(root / f"label_2/{name}.txt", Labels.from_boxes(box, ["Car"], CALIBRATION))
        record = Oxts.from_motion(np.eye(4), np.array([row, 0, 0]), 0.0, np.zeros(3))
        write_oxts(root / f"oxts/{name}.txt", record)
        (root / f"hits/{name}.npz").write_bytes(b"")
        (root / f"image_0/{name}.png").write_bytes(encode_gray(np.full((100, 160), row, np.uint8)))
        (root / f"image_2/{name}.png").write_bytes(encode_rgb(np.full((100, 160, 3), row, np.uint8)))
        (root / f"depth_0/{name}.png").write_bytes(encode_depth(np.full((100, 160), row + 1.0)))
        cameras = {"image_0": TwinCamera(np.eye(4), CALIBRATION.P2, 160, 100)}
        ego = Ego(np.eye(4), np.zeros(3), 0.0, np.zeros(3))
        frame = TwinFrame(name, row / 10, 0.1, ego, Lidar(np.eye(4), "hdl64e"), cameras, ())
        write_frame(root / f"twin/frames/{name}.json", frame)
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]]), np.array([[0, 1, 2]])
    write_glb(root / "twin/static.glb", Mesh.of(*square, "asphalt"))
    write_glb(root / "twin/models/hatchback_03.glb", Mesh.of(*square, "car_paint"))
    write_materials(root / "twin/materials.yaml", ["asphalt", "car_paint"])
    (root / "manifest.jsonl").write_text("".join(json.dumps({"name": name}) + "\n" for name in NAMES))
    (root / "ImageSets/train.txt").write_text("000002\n000000\n")
    pattern = {"name": "hdl64e", "sweep_s": 0.1, "elevation_deg": [0.0]}
    (root / "pattern.yaml").write_text(yaml.safe_dump(pattern))
    (root / "sensor.yaml").write_text("pattern: hdl64e\neffects: []\n")
    (root / "drive.yaml").write_text("kind: simulated\npattern: hdl64e\nsweep_s: 0.1\n")
    return root

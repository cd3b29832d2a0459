"""The rig has KITTI's signs and mount positions."""

from __future__ import annotations

import numpy as np
import pytest

from sensors.cameras import KITTI_CALIBRATION, kitti_cameras, lidar_pose_ego


def test_rotations_are_rotations():
    for transform in (KITTI_CALIBRATION.Tr_velo_to_cam, KITTI_CALIBRATION.Tr_imu_to_velo):
        rotation = transform[:, :3]
        assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_cameras_look_forward_from_kittis_height():
    pose = kitti_cameras(KITTI_CALIBRATION)["image_0"].pose
    assert np.allclose(pose[:3, 2], (1, 0, 0), atol=0.02) and np.allclose(pose[:3, 1], (0, 0, -1), atol=0.02)
    assert pose[2, 3] == pytest.approx(1.65, abs=0.02)


def test_the_right_cameras_see_a_point_further_left():
    cameras = kitti_cameras(KITTI_CALIBRATION)
    u = {name: camera.project([[0.0, 0.0, 10.0]])[0][0, 0] for name, camera in cameras.items()}
    assert u["image_1"] < u["image_3"] < u["image_0"] < u["image_2"]
    baseline_m = (u["image_0"] - u["image_1"]) * 10.0 / 721.5377
    assert baseline_m == pytest.approx(0.537, abs=0.001)


def test_lidar_points_project_equally_by_either_road():
    points = np.random.default_rng(0).uniform((5, -4, -2), (60, 4, 2), (50, 3))
    calibration, camera = KITTI_CALIBRATION, kitti_cameras(KITTI_CALIBRATION)["image_2"]
    homogeneous = np.c_[points, np.ones(50)]
    uvw = (calibration.Tr_velo_to_cam @ homogeneous.T).T @ calibration.P2[:, :3].T + calibration.P2[:, 3]
    ego = homogeneous @ lidar_pose_ego().T
    in_camera = (ego @ np.linalg.inv(camera.pose).T)[:, :3]
    uv, depth = camera.project(in_camera)
    assert np.allclose(uv, uvw[:, :2] / uvw[:, 2:]) and np.allclose(depth, uvw[:, 2])

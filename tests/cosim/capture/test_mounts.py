"""Sensors mounted elsewhere: calibration, labels, twin and points agree."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from cosim.capture.config import ConfigError, RunConfig, load_config
from cosim.capture.mounts import Mount, Mounts
from cosim.capture.navigation import Navigation
from cosim.drives.kitti import Drive
from cosim.drives.kitti.oxts import Oxts
from cosim.drives.twin import Ego
from cosim.export.source import instance_boxes, labelled_instances
from sensors.cameras import KITTI_CALIBRATION, lidar_pose_ego
from tests.sharing import record

MOUNTS = {
    "lidar": {"x_m": 1.2, "y_m": -0.4, "z_m": 2.1, "pitch_deg": 4, "yaw_deg": 20},
    "cameras": {"x_m": 1.9, "y_m": 0.3, "z_m": 1.4, "yaw_deg": -8},
}
NAVIGATION = {"gps_noise_m": 0.5, "gps_bias_m": 2.0, "gyro_bias_radps": 0.01}


@pytest.fixture(scope="module")
def drive(hamlet_config, tmp_path_factory):
    folder = tmp_path_factory.mktemp("mounts") / "drive"
    return Drive(record(hamlet_config, folder, images=["image_2"], mounts=MOUNTS, navigation=NAVIGATION))


def test_nothing_moved_is_kitti_to_the_last_digit():
    assert np.array_equal(Mounts().lidar_pose, lidar_pose_ego())
    for name, matrix in vars(KITTI_CALIBRATION).items():
        assert np.array_equal(getattr(Mounts().calibration, name), matrix)


def test_pitch_is_downwards_and_yaw_to_the_left():
    ahead = Mount(x_m=0, z_m=2, pitch_deg=10, yaw_deg=90).pose[:3, 0]
    assert ahead == pytest.approx([0, np.cos(np.radians(10)), -np.sin(np.radians(10))])


def test_a_mount_in_the_bodywork_is_refused_in_one_line(tmp_path):
    with pytest.raises(ValidationError, match="lies inside the vehicle"):
        Mount(x_m=0, z_m=1)
    (tmp_path / "c.yaml").write_text("mounts: {lidar: {x_m: 0.2, z_m: 0.9}}\n")
    with pytest.raises(ConfigError, match="lies inside the vehicle") as caught:
        load_config(tmp_path / "c.yaml")
    assert "\n" not in str(caught.value)


def test_twin_and_calibration_give_the_same_position_of_the_camera(drive):
    for frame in drive:
        by_calibration = frame.twin.lidar.pose_ego @ frame.calibration.rect_to_velo_matrix
        assert np.allclose(frame.twin.cameras["image_2"].pose_ego, by_calibration, atol=1e-6)
        assert frame.twin.lidar.pose_ego[:3, 3] == pytest.approx([1.2, -0.4, 2.1])


def test_the_road_lies_below_the_mount_where_the_twin_has_it(drive):
    """Between the road ahead and behind: the body pitches when it brakes."""
    for frame in drive:
        ego = frame.points[:, :3] @ frame.twin.lidar.pose_ego[:3, :3].T + frame.twin.lidar.pose_ego[:3, 3]
        lane = ego[(np.abs(ego[:, 0]) < 8) & (np.abs(ego[:, 1]) < 1.5)]
        ahead, behind = lane[lane[:, 0] > 4, 2], lane[lane[:, 0] < -4, 2]
        assert (np.median(ahead) + np.median(behind)) / 2 == pytest.approx(0, abs=0.1)


def test_labels_are_the_twins_boxes_and_project_into_their_image_boxes(drive):
    found = 0
    for frame in drive:
        labels, rows = frame.labels, labelled_instances(frame)
        things = instance_boxes(frame.twin)
        for i, row in enumerate(rows):
            if row < 0:
                continue
            found += 1
            box = labels[np.array([i])].boxes_velo(frame.calibration)
            assert np.linalg.norm(box.centre[0] - things.centre[row]) < 0.3
            pixel, depth = frame.calibration.project(things.centre[row][None], 2)
            if labels.truncated[i] < 0.05 and depth[0] > 3:
                left, top, right, bottom = labels.bbox[i]
                assert left - 1 <= pixel[0, 0] <= right + 1
                assert top - 1 <= pixel[0, 1] <= bottom + 1
    assert found > 0


def test_gps_errs_as_is_requested_and_the_twin_does_not(drive):
    off = [frame.oxts.pose[:3, 3] - frame.twin.ego.pose[:3, 3] for frame in drive]
    assert all(0.01 < np.linalg.norm(one) < 12 for one in off)
    assert np.linalg.norm(np.std(off, axis=0)) < 2.5  # noise about one bias


def test_errors_have_their_spread_and_follow_from_the_seed():
    ego = Ego(np.eye(4), np.array([8.0, 0, 0]), 0.1, np.zeros(3))
    errs = Navigation(gps_noise_m=0.5, velocity_noise_mps=0.2, gyro_noise_radps=0.03)
    records = [errs.measured(ego, seed=1, episode=0, frame=number) for number in range(400)]
    assert np.std([record.pose[0, 3] for record in records]) == pytest.approx(0.5, rel=0.15)
    assert np.std([record.ve for record in records]) == pytest.approx(0.2, rel=0.15)
    assert np.std([record.wz for record in records]) == pytest.approx(0.03, rel=0.15)
    assert errs.measured(ego, seed=1, episode=0, frame=7) == records[7]
    exact = Oxts.from_motion(ego.pose, ego.velocity_mps, ego.yaw_rate_radps, ego.acceleration_mps2)
    assert Navigation().measured(ego, seed=1, episode=0, frame=7) == exact


def test_the_settings_survive_a_drives_file():
    config = RunConfig.model_validate({"mounts": {"lidar": {"x_m": 0, "z_m": 2}}, "navigation": {"gps_noise_m": 1}})
    assert RunConfig.model_validate(config.model_dump(mode="json")) == config

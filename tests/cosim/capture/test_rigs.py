"""Rigs of several LiDARs and cameras, on a vehicle and on a mast: calibration, labels, twin and points agree."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from cosim.capture.config import RunConfig
from cosim.capture.placed_rig import place_rig
from cosim.drives.kitti import Drive
from cosim.drives.kitti.labels import read_labels
from cosim.drives.kitti.level import levelled
from cosim.drives.twin.scene import lidar_pose
from cosim.export.source import instance_boxes, point_instances
from sensors.cameras import KITTI_CALIBRATION, kitti_cameras, lidar_pose_ego
from sensors.rig import load_rig, rig_names
from tests.cosim.conftest import cosim, refused
from tests.sharing import made_once, record

K = [[300.0, 0, 159.5], [0, 300.0, 99.5], [0, 0, 1]]
CAMERA = {"width_px": 320, "height_px": 200, "K": K, "labels": True}
RIG = {
    "lidars": [
        {"name": "top", "sensor": "sensor.yaml", "mount": {"x_m": 0, "z_m": 2.0}},
        {"name": "left", "sensor": "sensor.yaml", "mount": {"x_m": 0.3, "y_m": 0.7, "z_m": 1.8, "roll_deg": -25}},
        {"name": "back", "sensor": "sensor.yaml", "mount": {"x_m": -1.7, "z_m": 0.9, "yaw_deg": 180}},
    ],
    "cameras": [
        {"name": "ahead", **CAMERA, "mount": {"x_m": 0.6, "z_m": 1.6, "pitch_deg": 6}},
        {
            "name": "behind_wide",
            **CAMERA,
            "mount": {"x_m": -0.9, "z_m": 1.6, "yaw_deg": 180},
            "distortion": {"model": "fisheye", "coefficients": [-0.03, 0.004, 0.0, 0.0]},
        },
    ],
}
MAST = {
    "carrier": "mast",
    "lidars": [{"name": "mast", "sensor": "sensor.yaml", "mount": {"x_m": 0, "z_m": 5, "pitch_deg": 10}}],
    "cameras": [{"name": "mast", **CAMERA, "mount": {"x_m": 0.2, "z_m": 4.8, "pitch_deg": 12}}],
}


def with_rig(folder: Path, hamlet_config: Path, rig: dict, **changes: object) -> Path:
    values = yaml.safe_load(hamlet_config.read_text())
    del values["sensor"], values["images"]
    for name in ("small.yaml", "sensor.yaml"):
        (folder / name).write_text((hamlet_config.parent / name).read_text())
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    values |= {"rig": str(folder / "rig.yaml"), "frames": 4, "annotators": {"enabled": False}, **changes}
    (folder / "run.yaml").write_text(yaml.safe_dump(values))
    return record(folder / "run.yaml", folder / "drive")


@pytest.fixture(scope="session")
def three(hamlet_config, tmp_path_factory) -> Path:
    company = {"every_s": 2.0, "company_m": 30}
    made = made_once(tmp_path_factory, "three", lambda folder: with_rig(folder, hamlet_config, RIG, collection=company))
    return made / "drive"


@pytest.fixture(scope="session")
def mast(hamlet_config, tmp_path_factory) -> Path:
    collection = {"every_s": 1.0, "company_m": 0}
    return (
        made_once(tmp_path_factory, "mast", lambda folder: with_rig(folder, hamlet_config, MAST, collection=collection))
        / "drive"
    )


def test_the_file_of_kittis_rig_is_kitti_to_the_last_digit():
    rig = place_rig(RunConfig())
    assert np.array_equal(rig.lidar_pose, lidar_pose_ego()) and np.array_equal(rig.level, np.eye(4))
    for name, matrix in vars(KITTI_CALIBRATION).items():
        assert np.array_equal(getattr(rig.calibrations["velodyne"], name), matrix)
    for name, camera in kitti_cameras(KITTI_CALIBRATION).items():
        placed = rig.cameras[name.removeprefix("image_")]
        assert np.array_equal(placed.P, camera.P) and (placed.width, placed.height) == (camera.width, camera.height)
        assert np.array_equal(rig.lidar_pose @ placed.in_lidar, camera.pose)


@pytest.mark.parametrize("name", rig_names())
def test_built_in_rigs_can_be_written_into_a_drives_settings(name):
    config = RunConfig(rig=name)
    assert config.rig_used == load_rig(name)
    again = RunConfig.model_validate(RunConfig(rig=load_rig(name)).model_dump(mode="json"))
    assert again.rig_used == load_rig(name) and again.images == config.images


def test_every_lidar_is_a_drive_of_its_own(three):
    drive = Drive(three)
    assert drive.lidars == ("back", "left") and drive.lidar == ""
    for name in drive.lidars:
        one = drive.of_lidar(name)
        assert (one.frames, one.lidar, one.base) == (drive.frames, name, three)
        frame = one[one.frames[0]]
        assert len(frame.points) > 500 and frame.has("hits") and frame.has("image_2") and frame.has("label_2")
        assert frame.twin.lidar.name == name and not one.missing


def test_all_lidars_see_the_same_road_under_the_vehicle(three):
    drive = Drive(three)
    for one in (drive, *map(drive.of_lidar, drive.lidars)):
        for frame in one:
            pose = frame.twin.lidar.pose_ego
            ego = frame.points[:, :3] @ pose[:3, :3].T + pose[:3, 3]
            near = np.hypot(ego[:, 0], ego[:, 1]) < 8
            assert np.percentile(ego[near, 2], 20) == pytest.approx(0, abs=0.12)


def test_calibrations_of_all_lidars_put_the_world_into_the_same_pixels(three):
    drive, points = Drive(three), np.array([[12.0, 3, 1, 1], [9, -4, 2, 1], [-11, 2, 1, 1], [-7, -3, 0.5, 1]])
    for frame in drive:
        world = points @ frame.twin.ego.pose.T
        for camera, seen in frame.twin.cameras.items():
            in_camera = world @ np.linalg.inv(frame.twin.ego.pose @ seen.pose_ego).T
            expected = in_camera @ seen.P.T
            for one in (frame, *(drive.of_lidar(name)[frame.name] for name in drive.lidars)):
                in_lidar = world @ np.linalg.inv(lidar_pose(one.twin)).T
                found = in_lidar @ one.calibration.to_pixels(camera.removeprefix("image_")).T
                assert np.allclose(found, expected, atol=1e-3)


def test_labels_of_every_camera_lie_on_its_objects(three):
    found = 0
    for frame in Drive(three):
        for camera in ("ahead", "behind_wide"):
            path = three / ("label_2" if camera == "ahead" else f"label_{camera}") / f"{frame.name}.txt"
            labels = read_labels(path).cared_for
            P, to_rect = frame.calibration.named[camera]
            things = instance_boxes(frame.twin)
            in_rect = things.centre @ to_rect[:3, :3].T + to_rect[:3, 3]
            for i in range(len(labels)):
                middle = labels.location[i] - [0, labels.dimensions[i, 0] / 2, 0]
                assert np.linalg.norm(in_rect - middle, axis=1).min() < 0.1
                u, v, depth = P @ [*middle, 1]
                left, top, right, bottom = labels.bbox[i]
                if labels.truncated[i] < 0.05 and depth > 3:
                    assert left - 1 <= u / depth <= right + 1 and top - 1 <= v / depth <= bottom + 1
                    found += 1
    assert found > 0


def test_boxes_fit_the_points_of_a_lidar_that_leans(three):
    """Points whose beams met a vehicle lie in its upright box."""
    drive = Drive(three).of_lidar("left")
    assert all(levelled(frame) is not frame for frame in drive)
    inside = sum(int((point_instances(frame) >= 0).sum()) for frame in drive)
    above = [levelled(frame).points[:, 2] + frame.twin.lidar.pose_ego[2, 3] for frame in drive]
    assert inside > 30 and all(np.percentile(heights, 1) > -1.5 for heights in above)


def test_variants_of_a_lidar_measure_what_it_measured(three, tmp_path):
    cosim("variants", three, "--lidar", "left", "--variant", three / "lidars/left/sensor.yaml", "--out", tmp_path / "v")
    made, own = Drive(tmp_path / "v/sensor"), Drive(three).of_lidar("left")
    for frame in own:
        assert np.array_equal(made[frame.name].points, frame.points)
        assert np.allclose(lidar_pose(made[frame.name].twin), lidar_pose(frame.twin), atol=1e-6)
        assert np.array_equal(made[frame.name].image("image_2"), frame.image("image_2"))


def test_a_comparison_takes_the_lidar_is_requested(three, tmp_path):
    sensor = three / "lidars/back/sensor.yaml"
    cosim("compare", three, "--lidar", "back", "--sensor", sensor, "--out", tmp_path, "--json", tmp_path / "c.json")
    assert yaml.safe_load((tmp_path / "c.json").read_text())["error"] < 0.05


def test_a_mast_does_not_move_next_to_the_road(mast):
    frames = list(Drive(mast))
    for frame in frames:
        assert not frame.twin.ego.velocity_mps.any() and frame.twin.ego.pose[2, 2] == 1
        assert frame.oxts.vf == 0
    places = {tuple(frame.twin.ego.pose[:3, 3]) for frame in frames}
    assert len(places) == 1  # one episode
    for frame in frames:
        pose = frame.twin.lidar.pose_ego
        foot = frame.points[:, :3] @ pose[:3, :3].T + pose[:3, 3]
        near = np.hypot(foot[:, 0], foot[:, 1]) < 18
        assert np.percentile(foot[near, 2], 20) == pytest.approx(0, abs=0.4)


def _rig(**changes: object) -> dict:
    return {**RIG, **changes}


@pytest.mark.parametrize(
    ("rig", "says"),
    [
        (_rig(lidars=[RIG["lidars"][0], RIG["lidars"][0]]), "two LiDARs are called 'top'"),
        (_rig(cameras=[]), "at least 1"),
        (_rig(lidars=[{"name": "x", "mount": {"x_m": 0, "z_m": 1}}]), "'x': \\(0, 0, 1\\) m lies inside the vehicle"),
        (_rig(cameras=[{**RIG["cameras"][0], "K": [[1, 2], [3, 4]]}]), "give 3 rows of 3 numbers"),
        (_rig(cameras=[{**RIG["cameras"][0], "K": [[0, 0, 1], [0, 5, 1], [0, 0, 1]]}]), "is no camera matrix"),
        (_rig(cameras=[{**RIG["cameras"][0], "K": "none"}]), "give a matrix as rows of numbers"),
        (_rig(cameras=[{**RIG["cameras"][0], "P": [[1, 0, 0, 0]] * 3}]), "give either K"),
        (
            _rig(cameras=[{**RIG["cameras"][0], "distortion": {"coefficients": [-5.0, 0.0, 0.0, 0.0]}}]),
            "cannot be undone|half field of view",
        ),
        (_rig(lidars=[{"name": "a b", "mount": {"x_m": 0, "z_m": 2}}]), "small letters, digits and _"),
        ("carrier: [", "cannot be read"),
    ],
)
def test_a_rig_that_cannot_be_is_refused_in_one_line(rig, says, tmp_path):
    (tmp_path / "rig.yaml").write_text(rig if isinstance(rig, str) else yaml.safe_dump(rig))
    assert re.search(says, refused("run", "--rig", tmp_path / "rig.yaml", "--out", tmp_path / "d"))


def test_settings_that_do_not_go_together_are_refused(tmp_path, three):
    (tmp_path / "c.yaml").write_text("rig: roof_three\nmounts: {lidar: {x_m: 0, z_m: 2}}\n")
    assert "write the mounts into the rig's file" in refused("run", tmp_path / "c.yaml", "--out", tmp_path / "d")
    message = refused("run", "--rig", "roof_three", "--sensor", "vlp16", "--out", tmp_path / "d")
    assert "every LiDAR of the rig names its own" in message
    assert "choose one of kitti, kitti_photo, mast" in refused("run", "--rig", "none", "--out", tmp_path / "d")
    assert (
        "is not an image folder" in refused("run", tmp_path / "i.yaml", "--out", tmp_path / "d")
        if ((tmp_path / "i.yaml").write_text("rig: roof_three\nimages: [image_2]\n"))
        else False
    )
    message = refused("compare", three, "--lidar", "roof", "--sensor", "vlp16")
    assert "no LiDAR 'roof'" in message and "back, left" in message

"""Every export is read back by a reader of the other side, and says what the drive says."""

from __future__ import annotations

import json
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

from cosim.cli import main
from cosim.drives.kitti import Drive, points_in_boxes
from cosim.drives.kitti.boxes import Boxes
from cosim.drives.twin.origin import read_origins
from cosim.errors import FormatError
from cosim.export import FORMATS, export
from cosim.export.source import ExportError, instance_boxes, sequences


@pytest.fixture(scope="module")
def drive(drive_folder):
    return Drive(drive_folder)


@pytest.fixture(scope="module")
def exported(drive, tmp_path_factory):
    """Folder of a format, written once."""
    done: dict[str, Path] = {}

    def write(name: str) -> Path:
        if name not in done:
            done[name] = tmp_path_factory.mktemp("export") / name
            export(drive, name, done[name])
        return done[name]

    return write


def test_the_command_writes_a_format_and_counts(drive_folder, tmp_path, capsys):
    assert main(["export", "pcd", str(drive_folder), "--out", str(tmp_path / "x"), "--json", str(tmp_path / "j")]) == 0
    assert len(list((tmp_path / "x").glob("*.pcd"))) == len(Drive(drive_folder))


@pytest.mark.parametrize("name", ["openpcdet", *FORMATS])
def test_an_unfinished_drive_is_refused_in_one_line(drive_folder, tmp_path, capsys, name):
    unfinished = tmp_path / "unfinished"
    shutil.copytree(drive_folder, unfinished, ignore=shutil.ignore_patterns("drive.yaml", "hits", "image_*", "twin"))
    assert main(["export", name, str(unfinished), "--out", str(tmp_path / "x")]) == 2
    message = capsys.readouterr().err.strip()
    assert "\n" not in message
    assert "unfinished" in message
    assert not (tmp_path / "x").exists()


def test_what_a_format_needs_and_a_drive_lacks_is_named(drive_folder, tmp_path):
    folder = tmp_path / "bare"
    shutil.copytree(drive_folder, folder, ignore=shutil.ignore_patterns("hits"))
    with pytest.raises(ExportError, match="semantickitti needs hits/"):
        export(Drive(folder), "semantickitti", tmp_path / "x")


def test_sequences_are_the_simulations(drive):
    found = sequences(drive)
    assert [len(one) for one in found] == [4, 4]
    assert all((np.diff(one.time_s) > 0).all() for one in found)


def test_pcd_read_by_pypcd4(drive, exported):
    pypcd4 = pytest.importorskip("pypcd4")
    for frame in drive:
        cloud = pypcd4.PointCloud.from_path(exported("pcd") / f"{frame.name}.pcd")
        assert np.array_equal(cloud.numpy(("x", "y", "z", "intensity")).astype(np.float32), frame.points)
        assert np.array_equal(cloud.pc_data["ring"], frame.rays.ring)
        assert np.allclose(cloud.pc_data["time"], frame.rays.time_s)


def test_las_read_by_laspy(drive, exported):
    laspy = pytest.importorskip("laspy")
    for frame in drive:
        las = laspy.read(exported("las") / f"{frame.name}.las")
        pose = frame.twin.ego.pose @ frame.twin.lidar.pose_ego
        back = (np.asarray(las.xyz) - pose[:3, 3]) @ pose[:3, :3]
        assert np.allclose(back, frame.points[:, :3], atol=2e-3)
        assert np.array_equal(las["ring"], frame.rays.ring)
        assert las.return_number.min() == 1


def test_tracking_read_by_pykitti(drive, exported):
    pykitti = pytest.importorskip("pykitti")
    root, tracked = exported("kitti-tracking"), 0
    for sequence in sequences(drive):
        data = pykitti.tracking(str(root / "training"), sequence.name)
        lines = (root / "training" / "label_02" / f"{sequence.name}.txt").read_text().splitlines()
        for index, frame in enumerate(sequence):
            assert np.array_equal(data.get_velo(index), frame.points)
            rows = [line.split() for line in lines if line.startswith(f"{index} ")]
            assert [row[2] for row in rows] == list(frame.labels.type)
            assert all(row[1] == "-1" for row in rows if row[2] == "DontCare")
            tracked += sum(row[1] != "-1" for row in rows)
    assert tracked > 0


def test_a_track_is_one_and_the_same_object(drive, exported):
    for sequence in sequences(drive):
        text = (exported("kitti-tracking") / "training" / "label_02" / f"{sequence.name}.txt").read_text()
        sizes: dict[str, set[tuple[str, ...]]] = {}
        for line in text.splitlines():
            row = line.split()
            if row[1] != "-1":
                sizes.setdefault(row[1], set()).add((row[2], *row[12:13]))
        assert all(len({kind for kind, _ in found}) == 1 for found in sizes.values())


def test_odometry_read_by_pykitti(drive, exported):
    pykitti = pytest.importorskip("pykitti")
    for sequence in sequences(drive):
        data = pykitti.odometry(str(exported("kitti-odometry")), f"{sequence.number:02d}")
        assert len(data.poses) == len(sequence)
        assert np.allclose(data.poses[0], np.eye(4), atol=1e-9)
        first, last = sequence.frames[0].twin, sequence.frames[-1].twin
        scan = sequence.frames[0].calibration.rect_to_velo_matrix
        there = first.ego.pose @ first.lidar.pose_ego @ scan @ data.poses[-1] @ np.linalg.inv(scan)
        assert np.allclose(there, last.ego.pose @ last.lidar.pose_ego, atol=1e-5)
        assert np.allclose(data.calib.T_cam0_velo, sequence.frames[0].calibration.velo_to_rect_matrix)
        assert np.array_equal(data.get_velo(1), sequence.frames[1].points)


def test_semantic_classes_follow_materials_and_boxes(drive, exported):
    root, seen = exported("semantickitti"), set()
    for sequence in sequences(drive):
        for index, frame in enumerate(sequence):
            path = root / "sequences" / f"{sequence.number:02d}" / "labels" / f"{index:06d}.label"
            word = np.fromfile(path, np.uint32)
            classes, instance = word & 0xFFFF, word >> 16
            assert len(word) == len(frame.points)
            vehicles = np.isin(classes, (10, 13, 15, 18, 252, 257, 255, 258))
            assert (instance[vehicles] > 0).all()
            assert (instance[np.isin(classes, (40, 50, 70))] == 0).all()
            inside = points_in_boxes(frame.points, instance_boxes(frame.twin), 0.1).any(0)
            assert np.array_equal(inside, instance > 0)
            road = frame.points[classes == 40]
            assert np.median(road[:, 2]) == pytest.approx(-1.73, abs=0.15)
            seen |= set(classes.tolist())
    assert {40, 50, 70, 10} <= seen


def test_mcap_read_by_its_own_library(drive, exported):
    reader = pytest.importorskip("mcap.reader")
    ros2 = pytest.importorskip("mcap_ros2.decoder")
    for sequence in sequences(drive):
        (path,) = (exported("mcap") / sequence.name).glob("*.mcap")
        with path.open("rb") as file:
            messages = list(reader.make_reader(file, decoder_factories=[ros2.DecoderFactory()]).iter_decoded_messages())
        clouds = [decoded for _, channel, _, decoded in messages if channel.topic == "/lidar/points"]
        assert len(clouds) == len(sequence)
        for cloud, frame in zip(clouds, sequence, strict=True):
            assert cloud.width == len(frame.points)
            x = np.frombuffer(cloud.data, np.uint8).reshape(-1, cloud.point_step)[:, :4].copy().view("<f4")[:, 0]
            assert np.array_equal(x, frame.points[:, 0])
        info = next(decoded for _, channel, _, decoded in messages if channel.topic == "/image_2/camera_info")
        assert np.allclose(np.reshape(info.p, (3, 4)), sequence.frames[0].twin.cameras["image_2"].P)
        tree = next(decoded for _, channel, _, decoded in messages if channel.topic == "/tf")
        assert [one.child_frame_id for one in tree.transforms][:2] == ["base_link", "lidar"]


def test_openlabel_holds_to_its_schema(drive, exported):
    import json

    jsonschema = pytest.importorskip("jsonschema")
    schema = pytest.importorskip("vcd.schema").openlabel_schema
    for sequence in sequences(drive):
        document = json.loads((exported("openlabel") / f"{sequence.name}.json").read_text())
        jsonschema.validate(document, schema)
        for index, frame in enumerate(sequence):
            objects = document["openlabel"]["frames"][str(index)]["objects"]
            names = {document["openlabel"]["objects"][key]["name"] for key in objects}
            assert names == {one.id for one in frame.twin.instances}


def test_nuscenes_read_by_its_devkit(drive, exported):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        nuscenes = pytest.importorskip("nuscenes.nuscenes")
        from nuscenes.utils.data_classes import LidarPointCloud
    root = exported("nuscenes")
    tables = nuscenes.NuScenes("v1.0-mini", str(root), verbose=False)
    assert [scene["nbr_samples"] for scene in tables.scene] == [4, 4]
    for sample, frame in zip(tables.sample, drive, strict=True):
        path, boxes, _ = tables.get_sample_data(sample["data"]["LIDAR_TOP"])
        assert np.allclose(LidarPointCloud.from_file(path).points[:3].T, frame.points[:, :3])
        ours = instance_boxes(frame.twin)
        for box in boxes:
            nearest = np.argmin(np.linalg.norm(ours.centre - box.center, axis=1))
            assert np.allclose(ours.centre[nearest], box.center, atol=0.05)
            assert np.allclose(ours.size[nearest][[1, 0, 2]], box.wlh, atol=1e-6)
        inside = points_in_boxes(frame.points, Boxes(ours.centre, ours.size, ours.yaw)).sum(1)
        assert sum(tables.get("sample_annotation", box.token)["num_lidar_pts"] for box in boxes) == inside.sum()


def test_points_of_nuscenes_fall_where_kitti_projects_them(drive, exported):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        nuscenes = pytest.importorskip("nuscenes.nuscenes")
    tables = nuscenes.NuScenes("v1.0-mini", str(exported("nuscenes")), verbose=False)
    frame, sample = drive[drive.frames[0]], tables.sample[0]
    _, _, intrinsic = tables.get_sample_data(sample["data"]["CAM_FRONT"])
    token = tables.get("sample_data", sample["data"]["CAM_FRONT"])["calibrated_sensor_token"]
    camera = tables.get("calibrated_sensor", token)
    from pyquaternion import Quaternion

    ahead = frame.points[frame.points[:, 0] > 5][:500, :3]
    ego = ahead @ frame.twin.lidar.pose_ego[:3, :3].T + frame.twin.lidar.pose_ego[:3, 3]
    local = (ego - camera["translation"]) @ Quaternion(camera["rotation"]).rotation_matrix
    pixels = local @ np.array(intrinsic).T
    expected, _ = frame.calibration.project(ahead, 2)
    assert np.allclose(pixels[:, :2] / pixels[:, 2:], expected, atol=0.5)


ORIGIN_M = np.array([691_000.0, 5_335_000.0, 0.0])


@pytest.fixture(scope="module")
def far_drive(drive_folder, tmp_path_factory):
    """The same drive, its twin about a local origin."""
    folder = tmp_path_factory.mktemp("far") / "drive"
    shutil.copytree(drive_folder, folder, ignore=shutil.ignore_patterns("hits", "depth_*"))
    (folder / "twin/origin.yaml").write_text("x: 691000.0\ny: 5335000.0\nz: 0.0\n")
    return Drive(folder)


def test_world_coordinates_are_those_of_the_network(drive, far_drive, exported, tmp_path):
    laspy = pytest.importorskip("laspy")
    for name in ("las", "nuscenes", "openlabel"):
        export(far_drive, name, tmp_path / name)
    first = f"{drive.frames[0]}.las"
    near, far = (laspy.read(folder / first) for folder in (exported("las"), tmp_path / "las"))
    assert np.allclose(np.asarray(far.xyz) - np.asarray(near.xyz), ORIGIN_M, atol=2e-3)
    poses = [
        json.loads(next(folder.rglob("ego_pose.json")).read_text()) for folder in _pair("nuscenes", exported, tmp_path)
    ]
    boxes = [
        json.loads(next(folder.rglob("sample_annotation.json")).read_text())
        for folder in _pair("nuscenes", exported, tmp_path)
    ]
    for near_rows, far_rows in (poses, boxes):
        moved = np.array([row["translation"] for row in far_rows]) - [row["translation"] for row in near_rows]
        assert np.allclose(moved, ORIGIN_M, atol=1e-6)
    labels = [json.loads((folder / "0000.json").read_text()) for folder in _pair("openlabel", exported, tmp_path)]
    near_pose, far_pose = (
        next(iter(next(iter(label["openlabel"]["frames"].values()))["frame_properties"]["transforms"].values()))
        for label in labels
    )
    moved = np.array(far_pose["transform_src_to_dst"]["matrix4x4"]) - near_pose["transform_src_to_dst"]["matrix4x4"]
    assert np.allclose(moved.reshape(4, 4)[:3, 3], ORIGIN_M, atol=1e-6)


def _pair(name, exported, folder):
    return exported(name), folder / name


def test_mcap_keeps_its_map_local_and_says_where_it_lies(far_drive, tmp_path):
    reader, decoder = pytest.importorskip("mcap.reader"), pytest.importorskip("mcap_ros2.decoder")
    export(far_drive, "mcap", tmp_path / "mcap")
    with next((tmp_path / "mcap").rglob("*.mcap")).open("rb") as stream:
        made = reader.make_reader(stream, decoder_factories=[decoder.DecoderFactory()])
        message = next(made.iter_decoded_messages(topics=["/tf"]))[3]
    world = message.transforms[0]
    assert (world.header.frame_id, world.child_frame_id) == ("world", "map")
    assert [world.transform.translation.x, world.transform.translation.y] == [691_000.0, 5_335_000.0]
    assert abs(message.transforms[1].transform.translation.x) < 10_000


def test_an_origin_that_is_none_is_refused(drive_folder, tmp_path):
    (tmp_path / "twin").mkdir()
    (tmp_path / "twin/origin.yaml").write_text("x: here\n")
    with pytest.raises(FormatError, match=r"origin\.yaml.*x, y and z in metres"):
        read_origins(tmp_path)

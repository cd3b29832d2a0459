"""`cosim twin` on real recordings and on what is not one."""

from __future__ import annotations

import json
import lzma
import shutil
from pathlib import Path

import numpy as np
import pytest

from cosim.cli import main
from cosim.drives.kitti import Drive, Labels
from cosim.drives.kitti.points import decode_points
from cosim.drives.kitti.rings import recover_rays
from cosim.drives.twin import read_glb, read_materials, read_trust
from cosim.labelled_twin.ground_surface import fit_ground
from cosim.labelled_twin.road_cells import find_road_cells
from sensors.bvh import Bvh


@pytest.fixture(scope="module")
def made(kitti_root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("twin") / "drive"
    assert main(["twin", str(kitti_root), "--out", str(folder), "--quiet", "--json", f"{folder}.json"]) == 0
    return folder


def test_the_result_is_a_measured_drive_with_a_twin(made: Path, kitti_root: Path) -> None:
    drive, source = Drive(made), Drive(kitti_root)
    assert drive.kind == "measured"
    assert drive.frames == source.frames
    assert drive.pattern == str(made / "pattern.yaml")
    assert not any(note.startswith(("twin", "the beam pattern", "sweep_s")) for note in drive.missing)
    materials = read_materials(drive.materials_path)
    result = json.loads(Path(f"{made}.json").read_text())
    for frame in drive:
        assert np.array_equal(frame.points, source[frame.name].points)
        assert np.array_equal(frame.twin.ego.pose, np.eye(4))
        labelled = frame.labels.of_type("Car", "Van", "Truck", "Pedestrian", "Cyclist")
        assert len(frame.twin.instances) == len(labelled)
        for instance in frame.twin.instances:
            assert set(read_glb(drive.model_path(instance.model)).material_names()) <= set(materials)
        assert [path.stem for path in frame.static_paths] == [frame.name]
        row = result["per_frame"][frame.name]
        assert row["points"] == len(frame.points)
        assert 0.05 < row["points_trusted"] / row["points"] < 0.9
        assert row["ground_sd_m"] < 0.04


def as_raw_drive(source: Drive, day: Path) -> Path:
    """One frame in the layout of KITTI's raw drives, with labels."""
    frame, calibration = source[source.frames[0]], source[source.frames[0]].calibration
    root, name = day / f"{day.name}_drive_0009_sync", "0000000007"
    for part, folder in (("velodyne", "velodyne_points/data"), ("label_2", "label_2")):
        (root / folder).mkdir(parents=True)
        shutil.copy(frame.path(part), (root / folder / name).with_suffix(frame.path(part).suffix))
    values = {
        "R": calibration.Tr_velo_to_cam[:, :3],
        "T": calibration.Tr_velo_to_cam[:, 3],
        "R_rect_00": calibration.R0_rect,
        "P_rect_02": calibration.P2,
    }
    rows = {
        key: f"{key}: {' '.join(f'{value:.12e}' for value in np.ravel(matrix))}\n" for key, matrix in values.items()
    }
    (day / "calib_velo_to_cam.txt").write_text(rows["R"] + rows["T"])
    (day / "calib_cam_to_cam.txt").write_text(rows["R_rect_00"] + rows["P_rect_02"])
    return root


def test_a_labelled_raw_drive_has_the_same_twin(made: Path, kitti_root: Path, tmp_path: Path) -> None:
    raw = as_raw_drive(Drive(kitti_root), tmp_path / "2011_09_26")
    out = tmp_path / "twin"
    assert main(["twin", str(raw), "--out", str(out), "--quiet"]) == 0
    frame, known = Drive(out)["0000000007"], next(iter(Drive(made)))
    assert np.array_equal(frame.points, known.points)
    np.testing.assert_allclose(frame.calibration.velo_to_rect_matrix, known.calibration.velo_to_rect_matrix, atol=1e-9)
    poses, others = ([instance.pose for instance in each.twin.instances] for each in (frame, known))
    np.testing.assert_allclose(poses, others, atol=1e-6)


def test_trusted_points_lie_on_the_twin(made: Path) -> None:
    for frame in Drive(made):
        trust = read_trust(frame.path("twin/trust"))
        pose = frame.twin.ego.pose @ frame.twin.lidar.pose_ego
        world = frame.points[:, :3].astype(float) @ pose[:3, :3].T + pose[:3, 3]
        ground = world[trust.measured(world, ())]
        start = (ground + np.array([0, 0, 2])).astype(np.float32)
        down = np.tile(np.float32([0, 0, -1]), (len(start), 1))
        mesh = read_glb(frame.static_paths[0])
        distance, triangle = Bvh(mesh).first_hit(start, down, np.full(len(start), 5, np.float32))
        assert (triangle >= 0).all()
        assert np.median(np.abs(distance - 2)) < 0.04
        assert np.quantile(np.abs(distance - 2 - trust.above_ground(ground)), 0.99) < 0.03


def test_running_it_again_changes_nothing_and_more_frames_can_follow(kitti_root: Path, tmp_path: Path) -> None:
    out, first = tmp_path / "out", tmp_path / "first.txt"
    names = Drive(kitti_root).frames
    first.write_text(f"{names[0]}\n")
    command = ["twin", str(kitti_root), "--out", str(out), "--quiet"]
    assert main([*command, "--frames", str(first)]) == 0
    assert Drive(out).frames == names[:1]
    before = {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert main([*command, "--frames", str(first)]) == 0
    assert before == {path.relative_to(out): path.read_bytes() for path in out.rglob("*") if path.is_file()}
    assert main([*command, "--frames", "train"]) == 0
    assert Drive(out).frames == names[:2]
    assert main([*command, "--pattern", "hdl64e"]) == 2


def test_mistakes_end_in_one_line(kitti_root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bare = tmp_path / "bare"
    for part in ("velodyne", "calib"):
        shutil.copytree(kitti_root / "training" / part, bare / part)
    wrong = tmp_path / "list.txt"
    wrong.write_text("123456\n")
    out = str(tmp_path / "out")
    for arguments, message in (
        ([str(bare)], "the twin is made from labels"),
        ([str(tmp_path / "none")], "no such folder"),
        ([str(kitti_root), "--frames", str(wrong)], "frame 123456 is not in"),
        ([str(kitti_root), "--frames", "nope"], "no ImageSets/nope.txt"),
        ([str(kitti_root), "--pattern", "hdl65e"], "does not exist"),
    ):
        assert main(["twin", *arguments, "--out", out]) == 2
        error = capsys.readouterr().err
        assert message in error
        assert error.count("\n") == 1
    assert main(["twin", str(kitti_root), "--out", str(kitti_root / "training")]) == 2


def test_the_ground_of_real_scans_is_a_cone_of_two_tenths_of_a_degree(kitti_source: Path) -> None:
    """What public odometry codes correct by hand: KITTI's beams look higher than its points say."""
    names = (kitti_source / "ImageSets" / "fit.txt").read_text().split()[::4]
    cones = []
    for name in names:
        packed = (kitti_source / "velodyne" / f"{name}.bin.xz").read_bytes()
        points, _ = decode_points(lzma.decompress(packed))
        rays = recover_rays(points, 0.1)
        found = fit_ground(find_road_cells(points, rays.ring, np.zeros(len(points), bool), 35.0))
        if found is not None and found[0].knows_cone:
            cones.append(np.degrees(found[0].cone_rad))
    assert len(cones) > len(names) / 2
    assert 0.1 < np.median(cones) < 0.28


def test_labels_of_nothing_make_a_twin_of_ground_alone(kitti_root: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(kitti_root / "training", copy)
    name = Drive(copy).frames[0]
    (copy / "label_2" / f"{name}.txt").write_text("")
    (tmp_path / "list").write_text(f"{name}\n")
    assert main(["twin", str(copy), "--out", str(tmp_path / "o"), "--quiet", "--frames", str(tmp_path / "list")]) == 0
    assert Drive(tmp_path / "o")[name].twin.instances == ()
    assert isinstance(Drive(tmp_path / "o")[name].labels, Labels)

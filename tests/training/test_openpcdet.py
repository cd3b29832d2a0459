"""What OpenPCDet's KITTI class needs is there and says what the labels say."""

from __future__ import annotations

import pickle

import numpy as np

from cosim.cli import main
from cosim.drives.kitti import Drive, points_in_boxes
from training.data.object_bank import as_boxes


def test_info_files_hold_boxes_in_lidar_axes_and_calibration(kitti_root, tmp_path):
    folder = tmp_path / "kitti"
    assert main(["export", "openpcdet", str(kitti_root), "--out", str(folder), "--quiet"]) == 0
    infos = pickle.loads((folder / "kitti_infos_trainval.pkl").read_bytes())
    names = (folder / "ImageSets" / "trainval.txt").read_text().split()
    assert [info["point_cloud"]["lidar_idx"] for info in infos] == names
    drive = Drive(folder)
    for info in infos:
        frame, annos = drive[info["point_cloud"]["lidar_idx"]], info["annos"]
        cared = frame.labels.cared_for
        assert annos["gt_boxes_lidar"].shape == (len(cared), 7)
        assert annos["name"].tolist() == [*cared.type, *["DontCare"] * (len(frame.labels) - len(cared))]
        projected = info["calib"]["P2"] @ info["calib"]["R0_rect"] @ info["calib"]["Tr_velo_to_cam"]
        centre = np.column_stack([annos["gt_boxes_lidar"][:, :3], np.ones(len(cared))]) @ projected.T
        u = centre[:, 0] / centre[:, 2]
        inside = (u > cared.bbox[:, 0]) & (u < cared.bbox[:, 2])
        assert inside[cared.truncated < 0.1].all()
        assert np.allclose(annos["dimensions"][: len(cared), 0], cared.dimensions[:, 2])


def test_objects_cut_out_are_the_points_in_the_box_about_its_middle(kitti_root, tmp_path):
    folder = tmp_path / "kitti"
    assert main(["export", "openpcdet", str(kitti_root), "--out", str(folder), "--quiet"]) == 0
    database = pickle.loads((folder / "kitti_dbinfos_train.pkl").read_bytes())
    drive = Drive(folder)
    assert "Car" in database
    for entry in database["Car"]:
        cut = np.fromfile(folder / entry["path"], np.float32).reshape(-1, 4)
        assert len(cut) == entry["num_points_in_gt"]
        box = entry["box3d_lidar"]
        assert len(cut) == points_in_boxes(drive[entry["image_idx"]].points, as_boxes(box[None])).sum()
        assert (np.abs(cut[:, :3]) <= np.linalg.norm(box[3:6]) / 2 + 1e-3).all()

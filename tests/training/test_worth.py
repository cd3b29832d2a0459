"""What effects are worth to a detector: scans of a twin with and without them, and what is found in these."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from assets.mesh import Mesh
from assets.models.build import build_model
from assets.models.catalogue import model_spec
from cosim.cli import main
from cosim.drives.kitti import Boxes, Drive, Labels, clip_boxes, project_corners, write_labels
from cosim.drives.twin.scene import lidar_pose
from cosim.variants.rescans import rescans, without
from sensors.effects.registry import find_effect
from sensors.sensor_model import load_sensor
from tests.cosim.discrepancy.small_drive import Yard, make_yard

NOISE = {"effect": "range_noise", "sigma_m": 0.01}
NEARLY_BLIND = {"effect": "random_dropout", "probability": 0.98}


def label(drive: Drive) -> None:
    """Write the boxes of the twin's cars as labels."""
    (drive.root / "label_2").mkdir()
    for frame in drive:
        to_lidar = np.linalg.inv(lidar_pose(frame.twin))
        poses = [to_lidar @ one.pose for one in frame.twin.instances]
        sizes = np.array([[one.length_m, one.width_m, one.height_m] for one in frame.twin.instances])
        middle = np.array([0, 0, sizes[0, 2] / 2])
        centres = np.stack([pose[:3, 3] for pose in poses]) + middle
        boxes = Boxes(centres, sizes, np.array([np.arctan2(pose[1, 0], pose[0, 0]) for pose in poses]))
        plain = Labels.from_boxes(boxes, ["Car"] * len(boxes), frame.calibration)
        outline = clip_boxes(project_corners(plain.corners_rect, frame.calibration.P2), 1242, 375)
        labels = Labels.from_boxes(boxes, ["Car"] * len(boxes), frame.calibration, bbox=outline)
        write_labels(drive.root / "label_2" / f"{frame.name}.txt", labels, 4)


def hatchback() -> Mesh:
    """The shape of a car, which the detector wants to see, in the size and paint of the yard's."""
    mesh = build_model("hatchback_01")
    return Mesh.of(mesh.vertices * (4.0, 1.8, 1.5) / model_spec("hatchback_01").size_m, mesh.faces, "car_paint")


@pytest.fixture(scope="session")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Yard:
    """Four labelled frames of a yard with a car."""
    made = make_yard(
        tmp_path_factory.mktemp("worth"),
        (find_effect("range_noise").model_validate({"sigma_m": 0.01}),),
        known=(NOISE,),
        frames=4,
        car=hatchback(),
    )
    label(Drive(made.drive))
    return made


def sensor_file(yard: Yard, name: str, *effects: dict) -> Path:
    path = yard.sensor.with_name(name)
    path.write_text(yaml.safe_dump({"pattern": "./pattern.yaml", "effects": list(effects)}))
    return path


def test_scans_of_the_twin_differ_only_by_the_removed_effect(yard):
    drive, blind = Drive(yard.drive), load_sensor(sensor_file(yard, "blind.yaml", NOISE, NEARLY_BLIND))
    plain = load_sensor(yard.sensor)
    (_, scans), *_ = rescans(drive, drive.frames[:1], [plain, blind, without(blind, "random_dropout")])
    assert np.array_equal(scans[0], scans[2])
    assert len(scans[1]) == pytest.approx(0.02 * len(scans[0]), rel=0.5)
    assert len(scans[0]) == len(drive[drive.frames[0]].points)


def test_leaving_an_addition_out_puts_back_what_was_there_before(yard):
    given = load_sensor(yard.sensor)
    more = load_sensor(sensor_file(yard, "more.yaml", {**NOISE, "sigma_m": 0.3}, NEARLY_BLIND))
    assert [one.name for one in without(more, "range_noise", given).effects] == ["random_dropout", "range_noise"]
    assert without(more, "range_noise", given).effects[-1] == given.effects[0]
    assert [one.name for one in without(more, "range_noise").effects] == ["random_dropout"]


def test_an_effect_that_hides_the_car_costs_all_detections(yard, tmp_path):
    sensor = sensor_file(yard, "blind2.yaml", NOISE, NEARLY_BLIND)
    given = ["compare", yard.drive, "--sensor", sensor, "--detector", "--out", tmp_path, "--json", tmp_path / "c.json"]
    assert main([str(word) for word in (*given, "--quiet")]) == 0
    worth = json.loads((tmp_path / "c.json").read_text())["worth"]
    hiding, noise = (
        {one["effect"]: one for one in worth["effects"]}[name] for name in ("random_dropout", "range_noise")
    )
    assert worth["frames"] == worth["objects"] == 4
    assert worth["ap_model"] == 0 and hiding["change"] == hiding["ap"] > 50
    assert hiding["ci95"][0] > 0 and noise["change"] == 0
    page = (tmp_path / "index.html").read_text()
    assert "without random_dropout" in page
    assert "<td>0.0 <small>0.0 – 0.0</small></td>" in page and "no difference" in page


def test_a_drive_without_labels_is_refused_in_a_line(biased_yard_unlabelled, tmp_path, capsys):
    drive, sensor = biased_yard_unlabelled
    assert main(["compare", str(drive), "--sensor", str(sensor), "--detector", "--out", str(tmp_path), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert "no label_2/" in error and error.count("\n") == 1


@pytest.fixture
def biased_yard_unlabelled(tmp_path) -> tuple[Path, Path]:
    made = make_yard(tmp_path / "bare", known=(NOISE,), frames=2)
    return made.drive, made.sensor


@pytest.mark.slow
def test_a_diagnosis_reports_the_effect_of_findings_on_detectors(yard, tmp_path):
    biased = make_yard(
        tmp_path / "biased",
        tuple(find_effect(name).model_validate(values) for name, values in (("range_bias", {"offset_m": 0.3}),)),
        known=(),
        frames=6,
        car=hatchback(),
    )
    label(Drive(biased.drive))
    given = ["diagnose", biased.drive, "--sensor", biased.sensor, "--detector", "--out", tmp_path / "page"]
    assert main([str(word) for word in (*given, "--json", tmp_path / "d.json", "--quiet")]) == 0
    found = json.loads((tmp_path / "d.json").read_text())
    assert [one["effect"] for one in found["worth"]["effects"]] == [one["effect"] for one in found["effects"]]
    assert "range_bias" in [one["effect"] for one in found["effects"]]
    assert found["worth"]["objects"] == 6
    assert "What each effect is worth" in (tmp_path / "page" / "index.html").read_text()

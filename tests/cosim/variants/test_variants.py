"""Drives measured again with other sensors: what is in them, what they share, and that they are right."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
import yaml

from cosim.drives.kitti import Drive, points_in_boxes
from cosim.engine import LocalEngine
from cosim.variants import PAPER, make_variants
from sensors.sensor_model import load_sensor
from tests.sharing import record

_MANY = 20  # points, of some boxes and not of others
TRACED = ("dual", "noise", "intensity", "raydrop")
_WARM = '''
"""A sensor that warms up."""
from dataclasses import replace
from typing import ClassVar
from sensors.effects import PointEffect, number


class Warm(PointEffect):
    """R + g·t."""

    name: ClassVar = "warm"
    channel: ClassVar = "range"
    equation: ClassVar = "R + g·t"
    example: ClassVar = {"gain_mps": 1e-3}

    gain_mps: float = number("growth", unit="m/s", ge=0, le=1)

    def apply(self, returns, shot, rng):
        """Longer."""
        return replace(returns, range_m=returns.range_m + self.gain_mps * shot.frame_time_s)
'''


def checksums(folder: Path, *parts: str) -> dict[str, str]:
    files = [path for part in parts or ("",) for path in sorted((folder / part).rglob("*")) if path.is_file()]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def by_beam(frame, pattern):
    """Ranges by beam, NaN where nothing returned; for fans with equal columns."""
    ranges = np.full((64, pattern["firings"]), np.nan)
    column = np.rint((np.pi - frame.rays.azimuth) / (2 * np.pi) * pattern["firings"] - 0.5).astype(int)
    ranges[frame.rays.ring, column % pattern["firings"]] = np.linalg.norm(frame.points[:, :3], axis=1)
    return ranges


@pytest.mark.parametrize("name", PAPER)
def test_a_variant_is_a_drive_that_detectors_read(variants_folder, source_drive, name):
    drive, source = Drive(variants_folder / name), Drive(source_drive)
    assert drive.frames == source.frames and drive.kind == "simulated"
    assert drive.split("train") == source.split("train") and drive.split("val") == source.split("val")
    for frame in drive:
        for part in ("velodyne", "rays", "label_2", "calib", "image_0", "image_2", "depth_0", "oxts", "twin/frames"):
            assert frame.has(part), part
        assert frame.bad_points == 0 and len(frame.points) > 20_000
        assert frame.points[:, 3].min() >= 0 and frame.points[:, 3].max() <= 1
        assert len(frame.labels.cared_for) == len(source[frame.name].labels.cared_for)
        assert frame.static_paths
    counts = yaml.safe_load((drive.root / "drive.yaml").read_text())["counts"]
    assert counts["frames"] == len(source) and counts["points"] == sum(len(frame.points) for frame in drive)
    lines = [json.loads(line) for line in (drive.root / "manifest.jsonl").read_text().splitlines()]
    listed = {file: digest for line in lines for file, digest in zip(line["files"], line["sha256"], strict=True)}
    assert listed == {file: digest for file, digest in checksums(drive.root).items() if file in listed}


def test_images_are_shared_with_the_drive_and_not_copied(variants_folder, source_drive):
    for part in ("image_0/000006.png", "image_2/000002.png", "calib/000006.txt", "twin/static.glb"):
        assert (variants_folder / "dual" / part).samefile(source_drive / part)


def test_the_drive_s_own_sensor_gives_the_drive_again(source_drive, tmp_path):
    make_variants(source_drive, str(source_drive / "sensor.yaml"), tmp_path / "v")
    parts = ("velodyne", "rays", "label_2")
    assert checksums(tmp_path / "v" / "sensor", *parts) == checksums(source_drive, *parts)


def test_label_effects_of_a_run_and_of_a_variant_of_it_are_the_same(hamlet_config, tmp_path):
    own = tmp_path / "tight.yaml"
    shrink = "{effect: box_shrink, a_m: [0.2, 0.05, 0.05], b: [0.25, 0.25, 0.05]}"
    pattern = hamlet_config.with_name("small.yaml")
    own.write_text(f"pattern: {pattern}\neffects: [{shrink}, {{effect: few_points, points: {_MANY}}}]\n")
    record(hamlet_config, tmp_path / "run", frames=2, sensor=str(own))
    make_variants(tmp_path / "run", str(own), tmp_path / "v")
    parts = ("velodyne", "label_2", "label_2_exact")
    assert checksums(tmp_path / "v" / "tight", *parts) == checksums(tmp_path / "run", *parts)
    for frame in Drive(tmp_path / "run"):
        held = points_in_boxes(frame.points, frame.labels.cared_for.boxes_velo(frame.calibration), margin_m=1e-3).sum(1)
        assert len(frame.labels) == len(frame.exact_labels) and (held >= _MANY).all()


def test_variants_keep_the_annotator_of_the_drive(hamlet_config, tmp_path):
    """Of one who labels nothing; a sensor with label effects of its own uses those."""
    pattern, nobody = hamlet_config.with_name("small.yaml"), tmp_path / "nobody.yaml"
    bare, own = tmp_path / "bare.yaml", tmp_path / "own.yaml"
    nobody.write_text("effects: [{effect: few_points, points: 10000}]\n")
    bare.write_text(f"pattern: {pattern}\n")
    own.write_text(f"pattern: {pattern}\neffects: [{{effect: few_points, points: 0}}]\n")
    record(hamlet_config, tmp_path / "run", frames=2, sensor=str(bare), labels={"annotator": str(nobody)})
    nobody.unlink()  # the drive has its own copy
    make_variants(tmp_path / "run", f"{bare},{own}", tmp_path / "v")
    parts = ("velodyne", "label_2", "label_2_exact")
    assert checksums(tmp_path / "v" / "bare", *parts) == checksums(tmp_path / "run", *parts)
    labelled = [len(frame.labels.cared_for) for frame in Drive(tmp_path / "v" / "own")]
    assert sum(labelled) and not sum(len(frame.labels.cared_for) for frame in Drive(tmp_path / "run"))


def test_a_fan_traced_again_in_the_twin_meets_what_was_stored(source_drive, tmp_path):
    """A shift of nothing makes new rays necessary and changes none."""
    own = tmp_path / "traced.yaml"
    own.write_text("pattern: hdl64e\neffects: [{effect: mount_translation, x_m: 0, y_m: 0, z_m: 0}]\n")
    make_variants(source_drive, str(own), tmp_path / "v")
    for frame in Drive(tmp_path / "v" / "traced"):
        stored = Drive(source_drive)[frame.name].points
        assert abs(len(stored) - len(frame.points)) < 30
        if len(stored) == len(frame.points):
            away = np.linalg.norm(stored[:, :3] - frame.points[:, :3], axis=1)
            assert np.quantile(away, 0.999) < 2e-3


@pytest.mark.parametrize("other", ["", ", {effect: mount_translation, x_m: 0, y_m: 0, z_m: 0}"])
def test_an_effect_of_one_s_own_knows_the_time_of_the_frame(source_drive, tmp_path, other):
    """Ranges grow by a millimetre a second of the drive, of stored hits and of new rays."""
    (tmp_path / "warm.py").write_text(_WARM)
    sensor = tmp_path / "warm.yaml"
    for kind, entry in (
        ("plain", "{effect: range_bias, offset_m: 0}"),
        ("warm", "{effect: ./warm.py:Warm, gain_mps: 0.001}"),
    ):
        sensor.with_name(f"{kind}.yaml").write_text(f"pattern: hdl64e\neffects: [{entry}{other}]\n")
        make_variants(source_drive, str(sensor.with_name(f"{kind}.yaml")), tmp_path / "v")
    for frame in Drive(tmp_path / "v" / "warm"):
        plain = Drive(tmp_path / "v" / "plain")[frame.name]
        longer = np.linalg.norm(frame.points[:, :3], axis=1) - np.linalg.norm(plain.points[:, :3], axis=1)
        assert np.median(longer) == pytest.approx(1e-3 * frame.twin.time_s, abs=1e-4)
        assert frame.twin.time_s > 1


def test_windows_answer_first_and_never_last(variants_folder):
    pattern = yaml.safe_load((variants_folder / "strongest/pattern.yaml").read_text())
    nearer = 0
    for name in Drive(variants_folder / "strongest").frames:
        first, strongest = (by_beam(Drive(variants_folder / v)[name], pattern) for v in ("first_hit", "strongest"))
        both = np.isfinite(first) & np.isfinite(strongest)
        assert (first[both] <= strongest[both] + 1e-3).all()
        nearer += np.count_nonzero(first[both] < strongest[both] - 0.05)
    assert nearer > 200


def test_noise_scatters_dual_by_a_tenth_of_a_metre_along_the_beam(variants_folder):
    for frame in Drive(variants_folder / "noise"):
        still = Drive(variants_folder / "dual")[frame.name]
        moved = frame.points[:, :3] - still.points[:, :3]
        direction = still.points[:, :3] / np.linalg.norm(still.points[:, :3], axis=1, keepdims=True)
        along = np.einsum("ij,ij->i", moved, direction)
        assert np.std(along) == pytest.approx(0.1, rel=0.02) and abs(np.mean(along)) < 2e-3
        np.testing.assert_array_equal(frame.points[:, 3], still.points[:, 3])


@pytest.mark.parametrize("name", ["intensity", "raydrop"])
def test_intensities_of_the_whole_drive_have_a_mean_of_about_three_tenths(variants_folder, name):
    mean = np.mean(np.concatenate([frame.points[:, 3] for frame in Drive(variants_folder / name)]))
    assert 0.2 <= mean <= 0.4


def test_ray_drop_takes_the_weakest_returns_and_no_others(variants_folder):
    for frame in Drive(variants_folder / "raydrop"):
        before = Drive(variants_folder / "intensity")[frame.name]
        assert 0 < len(before.points) - len(frame.points) < 0.2 * len(before.points)
        left = {row.tobytes() for row in frame.points[:, :3]}
        gone = np.array([row.tobytes() not in left for row in before.points[:, :3]])
        assert before.points[gone, 3].max() < 0.02 + 1e-6
        assert before.points[~gone, 3].min() > 0.02 - 1e-6


def test_shrunken_boxes_are_smaller_and_hold_what_the_scan_shows_of_the_vehicle(variants_folder):
    shrunk = 0
    for frame in Drive(variants_folder / "strongest"):
        exact, labels = frame.exact_labels.cared_for, frame.labels.cared_for
        assert exact.type == labels.type
        assert (labels.dimensions <= exact.dimensions + 1e-6).all()
        vehicle = np.isin(exact.type, ("Car", "Van", "Truck", "Misc"))
        np.testing.assert_array_equal(labels.dimensions[~vehicle], exact.dimensions[~vehicle])
        shrunk += np.count_nonzero(labels.dimensions[vehicle, 2] < exact.dimensions[vehicle, 2] - 0.19)
        before = points_in_boxes(frame.points, exact.boxes_velo(frame.calibration)).sum(1)
        after = points_in_boxes(frame.points, labels.boxes_velo(frame.calibration), margin_m=0.1).sum(1)
        many = vehicle & (before > 100)
        assert (after[many] > 0.8 * before[many]).all()
    assert shrunk > 5


def test_the_star_keeps_the_vehicles_own_boxes_and_shares_its_points(variants_folder, source_drive):
    star = variants_folder / "strongest_star"
    assert checksums(star, "label_2") == checksums(source_drive, "label_2")
    assert checksums(star, "velodyne") == checksums(variants_folder / "strongest", "velodyne")
    assert not (star / "label_2_exact").exists()


def test_an_interrupted_job_is_taken_up_and_gives_the_same_bytes(variants_folder, source_drive, tmp_path):
    class StopError(Exception):
        pass

    def stop(event):
        if event.kind == "frame":
            raise StopError

    with pytest.raises(StopError):
        make_variants(source_drive, "strongest,raydrop", tmp_path / "v", on_event=stop)
    assert not (tmp_path / "v/raydrop/drive.yaml").exists()
    result = make_variants(source_drive, "strongest,raydrop", tmp_path / "v", engine=LocalEngine(2))
    assert 0 < result.made < 4
    for name in ("strongest", "raydrop"):
        assert checksums(tmp_path / "v" / name) == checksums(variants_folder / name)
    assert make_variants(source_drive, "strongest,raydrop", tmp_path / "v").made == 0


def test_a_run_with_a_variant_s_sensor_measures_what_the_variant_of_a_run_does(hamlet_config, hamlet_drive, tmp_path):
    """The same world, seed, frames and times; the twin's files hold poses to a micrometre."""
    (tmp_path / "warm.py").write_text(_WARM)
    own = tmp_path / "raydrop.yaml"
    text = load_sensor("raydrop").to_yaml().replace("hdl64e", str(hamlet_config.with_name("small.yaml")))
    own.write_text(text + "- {effect: ./warm.py:Warm, gain_mps: 0.05}\n")
    record(hamlet_config, tmp_path / "run", sensor=str(own))
    make_variants(hamlet_drive, str(own), tmp_path / "v")
    away = []
    for frame in Drive(tmp_path / "run"):
        other = Drive(tmp_path / "v" / "raydrop")[frame.name]
        assert len(frame.points) == pytest.approx(len(other.points), rel=2e-3)
        assert frame.points[:, 3].mean() == pytest.approx(other.points[:, 3].mean(), abs=2e-3)
        mean_m, other_m = (np.linalg.norm(one.points[:, :3], axis=1).mean() for one in (frame, other))
        assert mean_m == pytest.approx(other_m, abs=0.05) and frame.twin.time_s > 2  # 0.1 m, and more with time
        assert frame.labels.type == other.labels.type and frame.has("label_2_exact")
        away += [np.abs(frame.labels.cared_for.dimensions - other.labels.cared_for.dimensions)]
    assert np.quantile(np.concatenate(away), 0.9) < 0.1  # the outermost noisy points decide

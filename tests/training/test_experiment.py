"""A table runs rows with frames, names the others, and continues from finished ones."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

pytest.importorskip("torch")

from cosim.cli import main
from tests.training.test_resuming import _TINY
from training.config import parse_train_config
from training.experiments import load_table, table_names
from training.experiments.comparisons import differences, gains
from training.experiments.frames import Inputs, match_steps, real_training_frames, tuned_config
from training.experiments.run import ExperimentRow


@pytest.fixture
def drives(tiny_drive: Path, tmp_path: Path) -> Path:
    return lay_out(tiny_drive, tmp_path)


def lay_out(tiny_drive: Path, folder: Path) -> Path:
    """Simulated and real frames, one drive under two names, and a configuration of a training of seconds."""
    for name, lists in (("variants/dual", ("train", "val")), ("real", ("fit", "test"))):
        drive = folder / name
        shutil.copytree(tiny_drive, drive)
        frames = (drive / "ImageSets" / "train.txt").read_text()
        for split in lists:
            (drive / "ImageSets" / f"{split}.txt").write_text(frames)
    config = {"model": _TINY, "epochs": 1, "batch_size": 2, "precision": "float32"}
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    return folder


def run(folder: Path, table: str, *further: object) -> dict:
    given = ["--variants", folder / "variants", "--real", folder / "real", "--config", folder / "config.yaml"]
    more = ["--out", folder / "out", "--json", folder / "table.json", "--quiet"]
    assert main([str(word) for word in ("experiment", table, *given, *more, *further)]) == 0
    return json.loads((folder / "table.json").read_text())


def test_rows_without_frames_contain_the_reason_and_the_papers_figures_are_included(drives):
    message = {row["name"]: row for row in run(drives, "synthetic_to_real")["rows"]}
    assert len(message["dual"]["3d"]) == 3 and message["dual"]["reason"] is None
    assert message["dual"]["paper_3d"] == [76.9, 64.3, 61.5]
    assert message["raydrop"]["3d"] is None and "cosim variants --variant raydrop" in message["raydrop"]["reason"]
    folder = drives / "out" / "tables" / "synthetic_to_real"
    assert "64.3" in (folder / "index.html").read_text() and "64.3" in (folder / "table.md").read_text()


def test_differences_of_similar_rows_are_not_significant_and_those_of_a_blind_row_are():
    settings = {"test": {"drive": "real"}}
    draws = np.random.default_rng(0).uniform(60, 80, 200)

    def row(name: str, mean: float, values: np.ndarray) -> ExperimentRow:
        scores = {"Car": {"3d": {"R40": [0.0, mean, 0.0]}}, "ci95": {}, "settings": settings}
        return ExperimentRow(name, {**scores, "draws_3d_moderate": values.tolist()})

    rows = [
        row("best", 70.1, draws),
        row("same", 70.0, draws - 0.1 + np.tile([1.0, -1.0], 100)),
        row("blind", 0, draws * 0),
    ]
    message = {comparison.name.split()[0]: comparison for comparison in differences(rows)}
    assert message["same"].low < 0 < message["same"].high and message["same"].verdict == "not significant"
    assert message["blind"].high < 0 and message["blind"].gap == pytest.approx(-70.1)
    assert message["blind"].verdict == "significant"


@pytest.fixture(scope="module")
def few_shot(tiny_drive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the table of few real frames was run."""
    folder = lay_out(tiny_drive, tmp_path_factory.mktemp("few_shot"))
    run(folder, "few_shot")
    return folder


def test_finished_rows_and_trainings_are_taken_up(few_shot):
    first = json.loads((few_shot / "table.json").read_text())
    checkpoints = {path: path.stat().st_mtime_ns for path in (few_shot / "out").rglob("*.pt")}
    assert {path.parent.name for path in checkpoints} == {"dual", "few-dual", "real-fit"}
    assert run(few_shot, "few_shot") == first
    run(few_shot, "synthetic")
    assert all(path.stat().st_mtime_ns == before for path, before in checkpoints.items())


def test_fine_tuning_is_reported_with_the_figures_before_and_the_row_of_real_frames(few_shot):
    rows = {row["name"]: row for row in run(few_shot, "few_shot")["rows"]}
    before = {row["name"]: row for row in run(few_shot, "synthetic_to_real", "--only", "dual")["rows"]}
    assert rows["dual"]["before"]["3d"] == before["dual"]["3d"]
    assert set(rows["dual"]["gain_ci95"]) <= {"3d", "bev"}
    assert rows["real"]["before"] is None and len(rows["real"]["3d"]) == 3
    assert "before fine-tuning" in (few_shot / "out" / "tables" / "few_shot" / "index.html").read_text()


def test_changes_for_fine_tuning_are_applied_and_validated_first(drives, capsys):
    (drives / "tune.yaml").write_text("epochs: 1\naugment: {tilt_deg: 0.5}\n")
    assert run(drives, "few_shot", "--fine-tune", drives / "tune.yaml")["rows"]
    tuned = yaml.safe_load((drives / "out" / "fine_tuned" / "few-dual" / "config.yaml").read_text())
    assert tuned["epochs"] == 1 and tuned["augment"]["tilt_deg"] == 0.5 and tuned["learning_rate"] == 0.0005
    (drives / "tune.yaml").write_text("epoch: 1\n")
    given = ["experiment", "few_shot", "--out", str(drives / "other"), "--fine-tune", str(drives / "tune.yaml")]
    assert main(given) == 2
    assert "tune.yaml: unknown key 'epoch'" in capsys.readouterr().err and not (drives / "other").exists()


def test_a_finished_row_with_other_settings_is_not_reused(drives, capsys):
    run(drives, "synthetic")
    config = yaml.safe_load((drives / "config.yaml").read_text())
    (drives / "config.yaml").write_text(yaml.safe_dump({**config, "seed": 5}))
    given = ["--variants", str(drives / "variants"), "--config", str(drives / "config.yaml"), "--out"]
    assert main(["experiment", "synthetic", *given, str(drives / "out")]) == 2
    assert "other settings (seed was 0)" in capsys.readouterr().err


def test_a_gain_is_after_minus_before():
    def scores(mean: float) -> dict:
        return {"Car": {"3d": {"R40": [0.0, mean, 0.0]}}}

    row = ExperimentRow("dual", {**scores(50.0), "before": scores(40.0), "gain_ci95": {"3d": [-2.0, 15.0]}})
    (gain,) = gains([row, ExperimentRow("real", scores(60.0))])
    assert gain.gap == pytest.approx(10) and gain.verdict == "not significant"


def test_fine_tuning_counts_epochs_whatever_the_training_counted():
    config = parse_train_config({"train": [], "steps": 1350}, "config")
    assert tuned_config(config, {}).steps is None
    assert tuned_config(config, {"steps": 300}).steps == 300


def test_fewer_real_frames_are_seen_for_as_many_steps(drives):
    (drives / "real" / "ImageSets" / "fit.txt").write_text("000000\n000001\n")
    config = parse_train_config({"train": [], "epochs": 3, "batch_size": 2}, "config")
    table, inputs = load_table("few_shot"), Inputs(drives / "variants", drives / "real", config, drives / "out")
    learnt = real_training_frames(table, inputs)
    simulated = len((drives / "variants" / "dual" / "ImageSets" / "train.txt").read_text().split())
    assert match_steps(config, learnt, table, inputs).epochs == 3 * -(-simulated // 2)


def test_the_papers_tables_are_there_and_whole():
    assert set(table_names()) == {"synthetic", "synthetic_to_real", "real_to_synthetic", "few_shot", "full"}
    for name in table_names():
        table = load_table(name)
        assert len(table.variants) == 8
        assert set(table.paper) <= {*table.variants, "real"}


def test_an_unknown_table_or_row_is_named(drives, capsys):
    assert main(["experiment", "nonsense", "--out", str(drives / "out")]) == 2
    assert "few_shot" in capsys.readouterr().err
    assert main(["experiment", "synthetic", "--only", "dull", "--out", str(drives / "out")]) == 2
    assert "'dull'" in capsys.readouterr().err


def test_a_trained_detectors_finds_can_be_scored(drives):
    train = drives / "train.yaml"
    config = {**yaml.safe_load((drives / "config.yaml").read_text()), "train": {"drive": str(drives / "real")}}
    train.write_text(yaml.safe_dump(config))
    assert main(["train", str(train), "--out", str(drives / "first"), "--quiet"]) == 0
    found, real = drives / "found", drives / "real"
    given = ["detect", drives / "first" / "checkpoint.pt", real, "--split", "test", "--out", found, "--quiet"]
    assert main([str(word) for word in given]) == 0
    assert {file.stem for file in found.iterdir()} == set((real / "ImageSets" / "test.txt").read_text().split())
    score = ["evaluate", "--detections", found, "--labels", real / "label_2", "--out", drives / "page", "--quiet"]
    assert main([str(word) for word in score]) == 0

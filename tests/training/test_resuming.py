"""A training that was stopped goes on as if it had not been; mistakes end in one line."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

torch = pytest.importorskip("torch")

from cosim.cli import main  # noqa: E402
from training.logs import read_log  # noqa: E402

_TINY = {
    "name": "pillars_small",
    "low_m": [0, -12.8, -3],
    "high_m": [25.6, 12.8, 1],
    "cell_m": [0.4, 0.4, 4],
    "layers": [1, 1, 1],
    "channels": [8, 8, 8],
    "upsample_channels": [8, 8, 8],
    "roi_count": 8,
    "roi_points": 16,
    "roi_channels": 16,
}


def write_config(folder: Path, drive: Path, **more: object) -> Path:
    values = {
        "train": {"drive": str(drive)},
        "model": _TINY,
        "epochs": 4,
        "batch_size": 2,
        "log_every": 1,
        "checkpoint_every": 1,
        "precision": "float32",
        **more,
    }
    path = folder / "config.yaml"
    path.write_text(yaml.safe_dump(values))
    return path


def curve(folder: Path) -> list[tuple[int, float]]:
    return [(entry["step"], entry["losses"]["total"]) for entry in read_log(folder) if "losses" in entry]


def test_an_interrupted_training_resumes_to_the_same_loss_curve(tiny_drive, tmp_path, monkeypatch):
    from training import loop

    config = write_config(tmp_path, tiny_drive)
    assert main(["train", str(config), "--out", str(tmp_path / "whole"), "--quiet"]) == 0
    stop_at, step = 5, loop.Training._step

    def stopping(self, model, batch, number):
        if number == stop_at:
            raise KeyboardInterrupt
        return step(self, model, batch, number)

    monkeypatch.setattr(loop.Training, "_step", stopping)
    assert main(["train", str(config), "--out", str(tmp_path / "parts"), "--quiet"]) == 130
    monkeypatch.setattr(loop.Training, "_step", step)
    assert len(curve(tmp_path / "parts")) == stop_at
    assert main(["train", str(config), "--out", str(tmp_path / "parts"), "--quiet"]) == 0
    assert curve(tmp_path / "parts") == curve(tmp_path / "whole")
    assert [number for number, _ in curve(tmp_path / "whole")] == list(range(1, 9))


def test_steps_end_a_training_within_an_epoch(tiny_drive, tmp_path):
    config = write_config(tmp_path, tiny_drive, steps=3, checkpoint_every=100)  # two steps are an epoch
    assert main(["train", str(config), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    assert [number for number, _ in curve(tmp_path / "out")] == [1, 2, 3]
    from training.checkpoints import read_checkpoint

    assert read_checkpoint(tmp_path / "out" / "checkpoint.pt")["step"] == 3


def test_other_settings_do_not_go_on_from_a_checkpoint(tiny_drive, tmp_path, capsys):
    config = write_config(tmp_path, tiny_drive, epochs=1)
    assert main(["train", str(config), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    write_config(tmp_path, tiny_drive, epochs=1, learning_rate=0.1)
    assert main(["train", str(config), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    assert "learning_rate was 0.003" in capsys.readouterr().err


def test_fine_tuning_starts_from_the_checkpoint_and_does_not_change_frozen_parts(tiny_drive, tmp_path):
    config = write_config(tmp_path, tiny_drive, epochs=1)
    assert main(["train", str(config), "--out", str(tmp_path / "first"), "--quiet"]) == 0
    checkpoint = tmp_path / "first" / "checkpoint.pt"
    write_config(tmp_path, tiny_drive, epochs=1, from_checkpoint=str(checkpoint), freeze=["vfe", "backbone_2d"])
    assert main(["train", str(config), "--out", str(tmp_path / "tuned"), "--quiet"]) == 0
    before, after = (torch.load(tmp_path / name / "checkpoint.pt")["weights"] for name in ("first", "tuned"))
    for name in before:
        assert torch.equal(before[name], after[name]) != name.startswith(("dense_head", "refiner")), name


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"train": {"drive": "nowhere"}}, "no such folder"),
        ({"train": []}, "empty"),
        ({"classes": ["Tram"]}, "Tram"),
        ({"epochz": 3}, "known keys"),
        ({"batch_size": 0}, "batch_size"),
        ({"from_checkpoint": "nothing.pt"}, "nothing.pt"),
        ({"freeze": ["neck"]}, "parts of pillars_small are vfe"),
        ({"model": {**_TINY, "layers": [1]}}, "one entry per stage"),
    ],
)
def test_errors_are_one_line(tiny_drive, tmp_path, capsys, change, words):
    config = write_config(tmp_path, tiny_drive, **change)
    assert main(["train", str(config), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1


def test_out_of_memory_error_names_the_setting_to_lower(tiny_drive, tmp_path, capsys, monkeypatch):
    from training import loop

    def full(*_):
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 2 GiB")

    monkeypatch.setattr(loop.Training, "_step", full)
    config = write_config(tmp_path, tiny_drive)
    assert main(["train", str(config), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert "lower `batch_size`" in error and error.count("\n") == 1


@pytest.mark.slow
def test_two_processes_train_one_detector(tiny_drive, tmp_path):
    config = write_config(tmp_path, tiny_drive, epochs=1, batch_size=1)
    command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node=2", "--standalone"]
    command += ["-m", "training.train", str(config), "--out", str(tmp_path / "out"), "--quiet"]
    result = subprocess.run(
        command, capture_output=True, text=True, timeout=300, env={**os.environ, "OMP_NUM_THREADS": "1"}
    )
    assert result.returncode == 0, result.stderr[-2000:]
    assert [number for number, _ in curve(tmp_path / "out")] == [1, 2]


def test_the_script_trains_as_the_command_does(tiny_drive, tmp_path, capsys):
    from training.train import main as script

    config = write_config(tmp_path, tiny_drive, epochs=1)
    assert main(["train", str(config), "--out", str(tmp_path / "command"), "--quiet"]) == 0
    assert script([str(config), "--out", str(tmp_path / "script"), "--json", str(tmp_path / "scores.json")]) == 0
    assert curve(tmp_path / "script") == curve(tmp_path / "command")
    assert json.loads((tmp_path / "scores.json").read_text()) == {"out": str(tmp_path / "script"), "scores": {}}
    capsys.readouterr()
    assert script([str(tmp_path / "none.yaml"), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1

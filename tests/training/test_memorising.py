"""Each detector learns a few frames by heart, and its loss falls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from training.config import parse_train_config  # noqa: E402
from training.evaluation import Evaluation  # noqa: E402
from training.logs import read_log  # noqa: E402
from training.run import Watcher, run_training  # noqa: E402

_SMALL = {"low_m": [0, -12.8, -3], "high_m": [25.6, 12.8, 1], "norm_momentum": 0.2}
_WIDTHS = {"layers": [1, 1, 1], "channels": [32, 32, 64], "upsample_channels": [32, 32, 32]}
DETECTORS: dict[str, tuple[dict[str, Any], int]] = {
    "pillars_small": ({**_WIDTHS, "cell_m": [0.2, 0.2, 4]}, 40),
    "pointpillars": ({**_WIDTHS, "cell_m": [0.32, 0.32, 4], "max_cells": 3000}, 60),
    "voxel_rcnn": (
        {
            "cell_m": [0.1, 0.1, 0.1],
            "layers": [1, 1],
            "channels": [32, 32],
            "upsample_channels": [32, 32],
            "sparse_channels": [8, 8, 16, 16, 16],
            "roi_grid": 4,
            "roi_channels": 64,
            "roi_count": 24,
            "roi_neighbours": 2,
            "dropout": 0.0,
        },
        50,
    ),
}


def trained(name: str, epochs: int, drive: Path, folder: Path) -> tuple[list[float], Evaluation]:
    """Losses step by step, and the scores on the frames that were learnt."""
    source = {"drive": str(drive), "split": "train"}
    config = parse_train_config(
        {
            "train": source,
            "validate_on": source,
            "model": {"name": name, **_SMALL, **DETECTORS[name][0]},
            "augment": {"flip": 0, "rotation_deg": 0, "scale": 0, "samples": {}},
            "epochs": epochs,
            "batch_size": 4,
            "learning_rate": 0.006,
            "validate_every": epochs,
            "log_every": 1,
            "precision": "float32",
        },
        name,
    )
    last: list[Evaluation] = []
    run_training(config, folder, Watcher(on_scores=lambda _, evaluation: last.append(evaluation)))
    return [entry["losses"]["total"] for entry in read_log(folder) if "losses" in entry], last[-1]


@pytest.mark.parametrize(
    "name",
    [
        "pillars_small",
        pytest.param("voxel_rcnn", marks=pytest.mark.slow),
        pytest.param("pointpillars", marks=pytest.mark.slow),
    ],
)
def test_a_few_frames_are_learnt_by_heart(name: str, tiny_drive: Path, tmp_path: Path):
    totals, scores = trained(name, DETECTORS[name][1], tiny_drive, tmp_path)
    assert np.mean(totals[-5:]) < 0.2 * np.mean(totals[:5])
    assert scores.results["Car"]["3d"][2].continuous > 95


@pytest.mark.parametrize("name", ["voxel_rcnn", "pointpillars"])
def test_a_loss_falls_by_a_third_within_six_epochs(name: str, tiny_drive: Path, tmp_path: Path):
    totals, _ = trained(name, 6, tiny_drive, tmp_path)
    assert len(totals) == 6 and totals[-1] < 0.67 * totals[0]

"""Run the rows of a table for which frames exist; finished rows and trainings are reused.

`OUT/detectors/NAME/` contains a training, shared by all tables; `OUT/fine_tuned/FEW|FULL-NAME/` its fine-tuning;
`OUT/tables/TABLE/NAME.json` a finished row, next to its detections.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.drives.writer import explained
from training.checkpoints import load_detector
from training.config import TrainConfig
from training.data.source import FrameSource
from training.devices import find_device
from training.evaluation import Evaluation
from training.evaluation.as_json import as_json
from training.evaluation.bootstrap import interval, resample
from training.experiments.frames import (
    Inputs,
    MissingFramesError,
    match_steps,
    real_frames,
    real_training_frames,
    simulated_frames,
    tuned_config,
)
from training.experiments.table import REAL, ExperimentTable
from training.loop import CHECKPOINT, decisive_settings
from training.run import Watcher, run_training, score

_CLASS = "Car"
_DRAWS = 1000
_METRICS = ("3d", "bev")
_MODERATE = 1

Draws = Mapping[str, list[np.ndarray]]
"""R40 of cars over draws of frames, by metric and difficulty."""


@dataclass(frozen=True, eq=False)
class ExperimentRow:
    """A row: its name, and its scores as JSON, or the reason why it was not run."""

    name: str
    scores: dict[str, Any] | None = None
    reason: str = ""


def run_table(
    table: ExperimentTable,
    name: str,
    inputs: Inputs,
    on_row: Callable[[str], None] = lambda name: None,
    watcher: Watcher | None = None,
    only: Sequence[str] | None = None,
) -> list[ExperimentRow]:
    """Run the rows of a table, or only those in `only`; rows with missing frames contain the reason."""
    rows = []
    for row in table.rows:
        if only is not None and row not in only:
            continue
        on_row(row)
        try:
            rows.append(_run_row(table, name, row, inputs, watcher))
        except MissingFramesError as missing:
            rows.append(ExperimentRow(row, reason=str(missing)))
    return rows


def _run_row(table: ExperimentTable, name: str, row: str, inputs: Inputs, watcher: Watcher | None) -> ExperimentRow:
    test = real_frames(inputs, inputs.test) if table.test_on == REAL else simulated_frames(row, inputs, "val")
    config, detector_name = inputs.config, row
    if table.train_on == REAL or row == REAL:
        train_source = real_training_frames(table, inputs)
        config, detector_name = match_steps(config, train_source, table, inputs), f"{REAL}-{train_source.split}"
    else:
        train_source = simulated_frames(row, inputs, "train")
    tuned_on, tuning = None, None
    if table.fine_tune != "none" and row != REAL:
        tuned_on = real_frames(inputs, inputs.few if table.fine_tune == "few" else inputs.full)
        tuning = inputs.fine_tune or tuned_config(config, {})
    folder = inputs.out / "tables" / Path(name).stem
    settings = _row_settings(config, train_source, test) | _tuning_settings(tuning, tuned_on)
    finished = folder / f"{row}.json"
    before = _read_finished(finished, settings)
    if before is not None:
        return ExperimentRow(row, before)
    checkpoint = _train(inputs.out / "detectors" / detector_name, config, train_source, watcher)
    if tuned_on is None or tuning is None:
        scores = _summarise(*_score_detector(checkpoint, test, inputs, folder / row))
    else:
        target = inputs.out / "fine_tuned" / f"{table.fine_tune}-{row}"
        tuned = _train(target, tuning.model_copy(update={"from_checkpoint": checkpoint}), tuned_on, watcher)
        untuned = _score_detector(checkpoint, test, inputs)
        after = _score_detector(tuned, test, inputs, folder / row)
        scores = {
            **_summarise(*after),
            "before": _summarise(*untuned),
            "gain_ci95": _gain_intervals(untuned[1], after[1]),
        }
    scores |= {"frames": len(test.open()[1]), "settings": settings}
    with explained(finished):
        finished.write_text(json.dumps(scores, indent=1) + "\n", encoding="utf-8")
    return ExperimentRow(row, scores)


def _train(folder: Path, config: TrainConfig, source: FrameSource, watcher: Watcher | None) -> Path:
    """Run or resume a training if it is not finished; returns its checkpoint."""
    config = config.model_copy(update={"train": (source,), "validate_on": ()})
    marker, settings = folder / "finished.json", config.model_dump(mode="json")
    if not (marker.is_file() and json.loads(marker.read_text(encoding="utf-8")) == settings):
        run_training(config, folder, watcher)
        with explained(marker):
            marker.write_text(json.dumps(settings, indent=1) + "\n", encoding="utf-8")
    return folder / CHECKPOINT


def _row_settings(config: TrainConfig, train_source: FrameSource, test: FrameSource) -> dict[str, Any]:
    """Settings that determine a row, to check whether a finished one is still valid."""
    frames = {"train": train_source.model_dump(mode="json"), "test": test.model_dump(mode="json")}
    return {**decisive_settings(config), **frames}


def _tuning_settings(tuning: TrainConfig | None, tuned_on: FrameSource | None) -> dict[str, Any]:
    if tuning is None or tuned_on is None:
        return {}
    return {"fine_tuning": {**decisive_settings(tuning), "train": tuned_on.model_dump(mode="json")}}


def _read_finished(path: Path, settings: dict[str, Any]) -> dict[str, Any] | None:
    if not path.is_file():
        return None
    scores = json.loads(path.read_text(encoding="utf-8"))
    return scores if scores.get("settings") == settings else None


def _score_detector(
    checkpoint: Path, test: FrameSource, inputs: Inputs, folder: Path | None = None
) -> tuple[Evaluation, Draws]:
    """Score a detector; detectors tested on the same frames get the same bootstrap draws."""
    detector, classes = load_detector(checkpoint)
    device = find_device(inputs.config.device)
    evaluation = score(detector.to(device), test, classes, device, folder)
    results = evaluation.results.get(_CLASS, {})
    draws = {
        metric: [resample(result, np.random.default_rng(0), _DRAWS)[:, 0] for result in results[metric]]
        for metric in _METRICS
        if metric in results
    }
    return evaluation, draws


def _summarise(evaluation: Evaluation, draws: Draws) -> dict[str, Any]:
    intervals = {metric: [list(interval(values)) for values in levels] for metric, levels in draws.items()}
    moderate = [round(value, 3) for value in draws["3d"][_MODERATE].tolist()] if "3d" in draws else None
    return {**as_json(evaluation), "ci95": intervals, "draws_3d_moderate": moderate}


def _gain_intervals(before: Draws, after: Draws) -> dict[str, list[float]]:
    """95 % intervals of the paired differences at moderate."""
    return {
        metric: list(interval(after[metric][_MODERATE] - before[metric][_MODERATE]))
        for metric in _METRICS
        if metric in before and metric in after
    }

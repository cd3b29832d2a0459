"""Runs the rows of a table that the data at hand allow, each once: what is there already is taken up.

`OUT/detectors/NAME/` holds a training, shared by all tables; `OUT/fine_tuned/FEW|FULL-NAME/` its fine-tuning;
`OUT/tables/TABLE/NAME.json` a finished row, beside its detections.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.drive_writer import explained
from cosim.kitti import Drive
from training.checkpoints import load_detector
from training.config import TrainConfig
from training.data.source import Source
from training.devices import find_device
from training.errors import TrainingError
from training.evaluation import Evaluation
from training.evaluation.as_json import as_json
from training.evaluation.bootstrap import interval, resample
from training.experiments.table import REAL, ExperimentTable
from training.loop import CHECKPOINT
from training.run import Watcher, run_training, score

_CLASS = "Car"
_DRAWS = 1000
_FEW_SHOT = {"epochs": 20, "learning_rate": 0.0005}


@dataclass(frozen=True)
class Inputs:
    """What experiments are run with.

    Attributes:
        variants: folder of simulated drives, one a variant, as `cosim variants` writes it; their lists train and val
            are trained and tested on.
        real: folder of real frames, or None.
        few: name of the list of few real frames to fine-tune on.
        full: name of the list of all real training frames.
        test: name of the list of real frames to test on.
        config: model, epochs and so on; its frames are replaced.
        fine_tune: keys of the configuration that fine-tuning changes.
        out: where everything is kept.
    """

    variants: Path | None
    real: Path | None
    config: TrainConfig
    out: Path
    few: str = "fit"
    full: str = "train"
    test: str = "test"
    fine_tune: dict[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class Row:
    """A row: its name, its scores as JSON, and the evaluation where it was made just now; or why it was not run."""

    name: str
    scores: dict[str, Any] | None = None
    evaluation: Evaluation | None = None
    reason: str = ""


def run_table(
    table: ExperimentTable,
    name: str,
    inputs: Inputs,
    on_row: Callable[[str], None] = lambda name: None,
    watcher: Watcher | None = None,
) -> list[Row]:
    """The rows of a table, run or taken up; those whose frames are not here say so."""
    rows = []
    names = [*table.variants, *([REAL] if REAL in table.paper and REAL not in table.variants else [])]
    for variant in names:
        on_row(variant)
        try:
            rows.append(_run_row(table, name, variant, inputs, watcher))
        except MissingFramesError as missing:
            rows.append(Row(variant, reason=str(missing)))
    return rows


class MissingFramesError(TrainingError):
    """A row's frames are not here."""


def _run_row(table: ExperimentTable, name: str, variant: str, inputs: Inputs, watcher: Watcher | None) -> Row:
    trained = REAL if table.train_on == REAL or variant == REAL else variant
    tested = REAL if table.test_on == REAL else variant
    test = _source(tested, inputs, inputs.test if tested == REAL else "val")
    learnt = _source(trained, inputs, _real_list(inputs) if trained == REAL else "train")
    folder = inputs.out / "tables" / Path(name).stem
    finished = folder / f"{variant}.json"
    settings = _told(inputs.config, learnt, test, table)
    before = _finished(finished, settings)
    if before is not None:
        return Row(variant, before)
    checkpoint = _train(inputs.out / "detectors" / trained, inputs.config, learnt, watcher)
    if table.fine_tune != "none" and variant != REAL:
        real = _source(REAL, inputs, inputs.few if table.fine_tune == "few" else inputs.full)
        changed = {**_FEW_SHOT, **(inputs.fine_tune or {}), "from_checkpoint": checkpoint}
        tuned = inputs.config.model_copy(update=changed)
        checkpoint = _train(inputs.out / "fine_tuned" / f"{table.fine_tune}-{variant}", tuned, real, watcher)
    detector, classes = load_detector(checkpoint)
    device = find_device(inputs.config.device)
    evaluation = score(detector.to(device), test, classes, device, folder / variant)
    draws = _draws(evaluation)
    intervals = {metric: [list(interval(values)) for values in levels] for metric, levels in draws.items()}
    moderate = [round(value, 3) for value in draws["3d"][1].tolist()] if "3d" in draws else None
    scores = {**as_json(evaluation), "ci95": intervals, "draws_3d_moderate": moderate, "settings": settings}
    with explained(finished):
        finished.write_text(json.dumps(scores, indent=1) + "\n", encoding="utf-8")
    return Row(variant, scores, evaluation)


def _train(folder: Path, config: TrainConfig, source: Source, watcher: Watcher | None) -> Path:
    """The checkpoint of a training that is run, gone on with, or finished already."""
    config = config.model_copy(update={"train": (source,), "validate_on": ()})
    marker, settings = folder / "finished.json", config.model_dump(mode="json")
    if not (marker.is_file() and json.loads(marker.read_text(encoding="utf-8")) == settings):
        run_training(config, folder, watcher)
        with explained(marker):
            marker.write_text(json.dumps(settings, indent=1) + "\n", encoding="utf-8")
    return folder / CHECKPOINT


def _source(name: str, inputs: Inputs, split: str) -> Source:
    """The frames of a variant, or the real ones.

    Raises:
        MissingFramesError: they are not here.
    """
    if name == REAL:
        if inputs.real is None:
            raise MissingFramesError("no real frames: name their folder with --real")
        folder = inputs.real
    else:
        if inputs.variants is None:
            raise MissingFramesError("no simulated frames: name the folder of cosim variants with --variants")
        folder = inputs.variants / name
    if not folder.is_dir():
        raise MissingFramesError(f"no drive at {folder}: make it with cosim variants --variant {name}")
    if split not in Drive(folder).splits:
        raise MissingFramesError(f"no list ImageSets/{split}.txt in {folder}")
    return Source(drive=folder, split=split)


def _real_list(inputs: Inputs) -> str:
    """All real training frames, or the few where there are no more."""
    if inputs.real is not None and inputs.full not in Drive(inputs.real).splits:
        return inputs.few
    return inputs.full


def _told(config: TrainConfig, learnt: Source, test: Source, table: ExperimentTable) -> dict[str, Any]:
    """What decides a row, to know whether a finished one still holds."""
    decisive = config.model_dump(mode="json", include={"model", "classes", "epochs", "batch_size", "learning_rate"})
    frames = {"train": learnt.model_dump(mode="json"), "test": test.model_dump(mode="json")}
    return {**decisive, **frames, "fine_tune": table.fine_tune}


def _finished(path: Path, settings: dict[str, Any]) -> dict[str, Any] | None:
    if not path.is_file():
        return None
    scores = json.loads(path.read_text(encoding="utf-8"))
    return scores if scores.get("settings") == settings else None


def _draws(evaluation: Evaluation) -> dict[str, list[np.ndarray]]:
    """R40 of cars over draws of frames, by metric and difficulty; the same draws for all rows of the same frames."""
    metrics = evaluation.results.get(_CLASS, {})
    return {
        metric: [resample(result, np.random.default_rng(0), _DRAWS)[:, 0] for result in metrics[metric]]
        for metric in ("3d", "bev")
        if metric in metrics
    }

"""Run a training from its configuration: read frames, train, validate, and write all results to one folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
import yaml

from cosim.drives.writer import explained
from training.config import TrainConfig
from training.data.source import FrameSource, read_samples
from training.devices import join_processes
from training.errors import TrainingError
from training.evaluation import Evaluation, evaluate, pair_frames
from training.evaluation.as_json import as_json
from training.loop import Moment, Training
from training.models.detector import Detector
from training.predict import predict, write_detections


@dataclass(frozen=True)
class Watcher:
    """Callbacks of a training: after each frame read, each step, and each validation of a drive."""

    on_read: Callable[[], None] = lambda: None
    on_step: Callable[[Moment], None] = lambda moment: None
    on_scores: Callable[[str, Evaluation], None] = lambda name, evaluation: None


def run_training(config: TrainConfig, folder: Path, watcher: Watcher | None = None) -> dict[str, Any]:
    """Train, or resume a training; returns the scores of the last validation by drive, as `evaluate --json` has them.

    Writes `config.yaml`, `log.jsonl`, `tensorboard/`, `checkpoint.pt`, and the detections on the frames of
    `validate_on` in `detections/NUMBER-NAME/`.

    Raises:
        TrainingError: no training frames, another training in the folder, or out of memory.
    """
    watcher = watcher or Watcher()
    scores: dict[str, Any] = {}
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with join_processes(config) as process:
        samples = read_samples(config.train, config.classes, watcher.on_read)

        def validate(detector: Detector) -> dict[str, Any]:
            scores.clear()
            for number, source in enumerate(config.validate_on):
                name = f"{number}-{source.drive.name}"
                evaluation = score(detector, source, config.classes, process.device, folder / "detections" / name)
                scores[name] = as_json(evaluation)
                watcher.on_scores(name, evaluation)
            return {name: _summarise(class_scores) for name, class_scores in scores.items()}

        training = Training(config, samples, folder, process, validate, watcher.on_step)
        if process.first:
            _write_config(config, folder)
        training.run()
        if process.first and config.validate_on and not scores:
            validate(training.detector)
    return scores


def score(
    detector: Detector, source: FrameSource, classes: tuple[str, ...], device: torch.device, folder: Path | None = None
) -> Evaluation:
    """Compute KITTI's metrics of a detector on labelled frames; detections are written to `folder` if given.

    Raises:
        TrainingError: a frame has no labels.
    """
    drive, names = source.open()
    unlabelled = [name for name in names if not drive[name].has("label_2")]
    if unlabelled:
        raise TrainingError(f"{source.drive}: frame {unlabelled[0]} has no label_2/; score on labelled frames only")
    detections = predict(detector, (drive[name] for name in names), classes, device)
    if folder is not None:
        write_detections(folder, names, detections)
    return evaluate(pair_frames([drive[name].labels for name in names], detections, names))


def _summarise(class_scores: dict[str, Any]) -> dict[str, Any]:
    """R40 at moderate by class and metric."""
    return {
        name: {metric: metrics[metric]["R40"][1] for metric in ("3d", "bev") if metrics.get(metric)}
        for name, metrics in class_scores.items()
        if metrics
    }


def _write_config(config: TrainConfig, folder: Path) -> None:
    with explained(folder / "config.yaml"):
        text = yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False)
        (folder / "config.yaml").write_text(text, encoding="utf-8")

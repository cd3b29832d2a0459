"""Training and test frames of the rows of a table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cosim.drives.kitti import Drive
from training.config import TrainConfig, parse_train_config
from training.data.source import FrameSource
from training.errors import TrainingError
from training.experiments.table import ExperimentTable

_FINE_TUNING = {"epochs": 20, "steps": None, "learning_rate": 0.0005}


@dataclass(frozen=True)
class Inputs:
    """Inputs of experiments.

    Attributes:
        variants: folder of simulated drives, one per variant, as `cosim variants` writes it; their lists train and val
            are trained and tested on.
        real: folder of real frames, or None.
        few: name of the list of few real frames to fine-tune on.
        full: name of the list of all real training frames.
        test: name of the list of real frames to test on.
        config: training configuration; its frames are replaced.
        fine_tune: configuration of fine-tuning from `tuned_config`; its frames and initial weights are replaced.
        out: output folder.
    """

    variants: Path | None
    real: Path | None
    config: TrainConfig
    out: Path
    few: str = "fit"
    full: str = "train"
    test: str = "test"
    fine_tune: TrainConfig | None = None


class MissingFramesError(TrainingError):
    """The frames of a row do not exist."""


def tuned_config(config: TrainConfig, changes: dict[str, Any], where: str = "fine-tuning") -> TrainConfig:
    """Return the configuration of fine-tuning: 20 epochs at a low learning rate, and the given changes.

    Raises:
        TrainingError: an unknown key or a value out of bounds; the message starts with `where`.
    """
    return parse_train_config({**config.model_dump(mode="json"), **_FINE_TUNING, **changes}, where)


def simulated_frames(variant: str, inputs: Inputs, split: str) -> FrameSource:
    """Frames of a list of a variant.

    Raises:
        MissingFramesError: it does not exist.
    """
    if inputs.variants is None:
        raise MissingFramesError("no simulated frames: name the folder of cosim variants with --variants")
    return _list_source(inputs.variants / variant, split, variant)


def real_frames(inputs: Inputs, split: str) -> FrameSource:
    """Frames of a list of the real frames.

    Raises:
        MissingFramesError: it does not exist.
    """
    if inputs.real is None:
        raise MissingFramesError("no real frames: name their folder with --real")
    return _list_source(inputs.real, split)


def real_training_frames(table: ExperimentTable, inputs: Inputs) -> FrameSource:
    """Real training frames of a detector: all, or the few if there is no larger list."""
    use_full = inputs.real is not None and inputs.full in Drive(inputs.real).splits
    return real_frames(inputs, inputs.full if use_full and table.fine_tune != "few" else inputs.few)


def match_steps(config: TrainConfig, source: FrameSource, table: ExperimentTable, inputs: Inputs) -> TrainConfig:
    """Return the configuration for fewer frames than those of the variants: more epochs, equally many steps."""
    counts = [0]
    for variant in table.variants:
        try:
            counts.append(len(simulated_frames(variant, inputs, "train").open()[1]))
        except MissingFramesError:
            continue
    variant_steps, own_steps = (-(-count // config.batch_size) for count in (max(counts), len(source.open()[1])))
    return config.model_copy(
        update={"epochs": max(config.epochs, round(config.epochs * variant_steps / max(own_steps, 1)))}
    )


def _list_source(folder: Path, split: str, variant: str = "") -> FrameSource:
    if not folder.is_dir():
        remedy = f"make it with cosim variants --variant {variant}" if variant else "name another folder with --real"
        raise MissingFramesError(f"no drive at {folder}: {remedy}")
    if split not in Drive(folder).splits:
        raise MissingFramesError(f"no list ImageSets/{split}.txt in {folder}")
    return FrameSource(drive=folder, split=split)

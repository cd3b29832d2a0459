"""Checkpoints: atomic writing and reading of cosim's files, and weights of other frameworks."""

from __future__ import annotations

import os
import pickle
import struct
from pathlib import Path
from typing import Any

import torch
from pydantic import ValidationError
from torch import Tensor

from cosim.drives.writer import explained
from sensors.pattern import first_problem
from training.errors import TrainingError
from training.models.build import build_detector
from training.models.detector import Detector
from training.models.foreign_weights import translate
from training.models.pillar_detector import SECOND_STAGE
from training.models.settings import ModelSettings

FORMAT = 1
#: Defaults of keys that are missing in checkpoints of earlier versions.
_OLD_DEFAULTS = {"level_ground": False, "intensity": True, "refine": False}


def save_checkpoint(
    path: Path, detector: Detector, settings: ModelSettings, classes: tuple[str, ...], **more: Any
) -> None:
    """Write a checkpoint atomically."""
    content = {
        "format": FORMAT,
        "model": settings.model_dump(mode="json"),
        "classes": list(classes),
        "weights": detector.state_dict(),
        **more,
    }
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    with explained(path):
        with partial.open("wb") as file:
            torch.save(content, file)
            file.flush()
            os.fsync(file.fileno())
        partial.rename(path)


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read the content of a checkpoint file, on the CPU.

    Raises:
        TrainingError: missing, or not a file of tensors.
    """
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise TrainingError(f"{path}: cannot be read ({error.strerror}); give a checkpoint file") from None
    except (RuntimeError, pickle.UnpicklingError, EOFError, ValueError, LookupError, struct.error):
        raise TrainingError(
            f"{path}: not a checkpoint that contains only tensors; save its state_dict with torch.save"
        ) from None
    if not isinstance(content, dict):
        raise TrainingError(f"{path}: contains {type(content).__name__}; a checkpoint is a dictionary of weights")
    return content


def load_weights(detector: Detector, path: Path, classes: tuple[str, ...]) -> None:
    """Load the weights of a checkpoint, cosim's or another framework's, into a detector.

    A checkpoint of a first stage does not change the second stage.

    Raises:
        TrainingError: the architecture differs; the message lists the keys.
    """
    content = read_checkpoint(path)
    weights = _parse_own(content, path)[2] if content.get("format") == FORMAT else translate(content, classes).weights
    if not any(key.startswith(SECOND_STAGE) for key in weights):
        second_stage = {key: value for key, value in detector.state_dict().items() if key.startswith(SECOND_STAGE)}
        weights = {**weights, **second_stage}
    demand_same_keys(detector.state_dict(), weights, path)
    detector.load_state_dict(weights)


def load_detector(
    path: Path, model: ModelSettings | None = None, classes: tuple[str, ...] = ()
) -> tuple[Detector, tuple[str, ...]]:
    """Load a detector with its weights; returns the detector and its classes.

    Args:
        path: a checkpoint.
        model: settings for a checkpoint of another framework (default: `pointpillars`); cosim's contain their own.
        classes: likewise; by default Car, Pedestrian, Cyclist.
    """
    content = read_checkpoint(path)
    if content.get("format") == FORMAT:
        settings, class_names, weights = _parse_own(content, path)
    else:
        class_names = classes or ("Car", "Pedestrian", "Cyclist")
        translated = translate(content, class_names)
        settings, weights = model or ModelSettings(name="pointpillars"), translated.weights
        settings = settings.model_copy(update={"direction_offset_rad": translated.direction_offset_rad})
    detector = build_detector(settings, class_names)
    demand_same_keys(detector.state_dict(), weights, path)
    detector.load_state_dict(weights)
    return detector, class_names


def _parse_own(content: dict[str, Any], path: Path) -> tuple[ModelSettings, tuple[str, ...], dict[str, Tensor]]:
    """Model, classes and weights of a checkpoint of cosim train.

    Raises:
        TrainingError: a part is missing, or another version wrote it.
    """
    absent = [name for name in ("model", "classes", "weights") if name not in content]
    if absent:
        raise TrainingError(f"{path}: it contains no {absent[0]}; use a checkpoint.pt written by cosim train")
    try:
        settings = ModelSettings.model_validate({**_OLD_DEFAULTS, **content["model"]})
    except ValidationError as error:
        raise TrainingError(
            f"{path}: {first_problem(error)}; another version of cosim wrote it, use it with that one"
        ) from error
    return settings, tuple(content["classes"]), content["weights"]


def demand_same_keys(expected: dict[str, Tensor], actual: dict[str, Tensor], path: Path) -> None:
    """Check that names and shapes are the same.

    Raises:
        TrainingError: they differ; the message lists the differences.
    """
    missing = [key for key in expected if key not in actual]
    extra = [key for key in actual if key not in expected]
    shapes = [
        f"{key} is {tuple(actual[key].shape)}, not {tuple(expected[key].shape)}"
        for key in expected
        if key in actual and actual[key].shape != expected[key].shape
    ]
    parts = [
        f"{len(keys)} {word} ({', '.join(keys[:4])}{' …' if len(keys) > 4 else ''})"
        for word, keys in (("missing", missing), ("unknown", extra), ("of another shape", shapes))
        if keys
    ]
    if parts:
        raise TrainingError(f"{path}: weights of another architecture: {'; '.join(parts)}; change `model` or the file")

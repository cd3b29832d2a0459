"""Configuration of a training."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from assets.documents import DocumentError, parse_yaml
from cosim.drives.files import read_text
from sensors.pattern import first_problem
from training.data.augment import Augment
from training.data.source import FrameSource
from training.errors import TrainingError
from training.models.settings import ModelSettings

Precision = Literal["auto", "float32", "bfloat16", "float16"]


class TrainConfig(BaseModel):
    """A training. The losses depend only on the configuration and the number of processes, interrupted or not."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    train: tuple[FrameSource, ...] = Field(description="training frames: `drive`, and `split`, `frames` or `count`")
    validate_on: tuple[FrameSource, ...] = Field(default=(), description="frames for validation during training")
    out: Path | None = Field(default=None, description="folder of checkpoints and logs; `--out` takes precedence")
    model: ModelSettings = Field(default=ModelSettings(), description="the detector: a preset's name, or its keys")
    classes: tuple[str, ...] = Field(default=("Car",), min_length=1, description="classes to detect")
    epochs: int = Field(default=15, ge=1, le=10_000, description="passes over all frames")
    steps: int | None = Field(
        default=None, ge=1, description="total number of steps, instead of `epochs`; none: from `epochs`"
    )
    batch_size: int = Field(default=4, ge=1, le=1024, description="frames per step and process")
    learning_rate: float = Field(default=0.003, gt=0, le=1, description="maximum of the one-cycle schedule")
    weight_decay: float = Field(default=0.01, ge=0, le=1, description="of AdamW")
    gradient_norm: float = Field(default=10.0, gt=0, description="maximum norm of gradients")
    augment: Augment = Field(default=Augment(), description="augmentation of frames")
    seed: int = Field(default=0, ge=0, lt=2**31, description="seed of weights, order and augmentation")
    from_checkpoint: Path | None = Field(default=None, description="weights to start from, for fine-tuning")
    freeze: tuple[str, ...] = Field(default=(), description="parts that are not trained, such as backbone_2d")
    precision: Precision = Field(
        default="auto",
        description="of the convolutions; auto: bfloat16 or float16 on a GPU, bfloat16 on CPUs with AMX or AVX-512 "
        "BF16, else float32",
    )
    device: Literal["auto", "cpu", "cuda"] = Field(default="auto", description="auto: a GPU if there is one")
    workers: int = Field(default=0, ge=0, le=256, description="number of data-loading processes")
    checkpoint_every: int = Field(default=200, ge=1, description="steps between checkpoints; also after each epoch")
    validate_every: int = Field(default=5, ge=1, description="epochs between validations; also after the last")
    log_every: int = Field(default=10, ge=1, description="steps between lines of the log")

    @field_validator("train", "validate_on", mode="before")
    @classmethod
    def _one_or_many(cls, given: object) -> object:
        return (given,) if isinstance(given, dict) else given


def load_train_config(path: Path) -> TrainConfig:
    """Read a configuration from a YAML file; paths in it are relative to the working folder.

    Raises:
        TrainingError: unreadable, not YAML, an unknown key or a value out of bounds.
    """
    return parse_train_config(read_settings(path), str(path))


def read_settings(path: Path) -> dict:
    """Read the keys and values of a YAML file.

    Raises:
        TrainingError: not YAML, or no keys with values.
        FormatError: it is missing or unreadable.
    """
    try:
        loaded = parse_yaml(read_text(path))
    except DocumentError as error:
        raise TrainingError(f"{path} is not YAML: {error}") from error
    if not isinstance(loaded, dict):
        raise TrainingError(
            f"{path} contains {type(loaded).__name__}, not keys and values; write `train: {{drive: DIR}}`"
        )
    return loaded


def parse_train_config(values: dict, where: str) -> TrainConfig:
    """Parse a configuration from keys and values; errors start with `where`."""
    try:
        return TrainConfig.model_validate(values)
    except ValidationError as error:
        unknown = error.errors()[0]["type"] == "extra_forbidden"
        hint = f"; known keys are {', '.join(TrainConfig.model_fields)}" if unknown else ""
        raise TrainingError(f"{where}: {first_problem(error)}{hint}") from error

"""Definition of a table of the paper: detectors and their test frames."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cosim.drives.files import read_text
from sensors.pattern import first_problem
from training.errors import TrainingError

VARIANTS = ("strongest_star", "strongest", "first_hit", "depth", "dual", "noise", "intensity", "raydrop")
REAL = "real"


class ExperimentTable(BaseModel):
    """A table: one row per variant, each a detector with its scores."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    title: str = Field(description="heading of the table")
    train_on: Literal["synthetic", "real"] = Field(description="what detectors are trained on")
    test_on: Literal["synthetic", "real"] = Field(description="what they are tested on")
    fine_tune: Literal["none", "few", "full"] = Field(
        default="none", description="then fine-tuned on a few or on all real training frames"
    )
    variants: tuple[str, ...] = Field(default=VARIANTS, min_length=1, description="names of the rows")
    paper: dict[str, tuple[float, float, float]] = Field(
        default_factory=dict, description="the paper's own figures: AP easy, moderate, hard [%]"
    )

    @property
    def rows(self) -> tuple[str, ...]:
        """The variants, and a row for real frames only, if the paper has one or the table is fine-tuned."""
        has_real_row = REAL in self.paper or self.fine_tune != "none"
        return (*self.variants, REAL) if has_real_row and REAL not in self.variants else self.variants


def table_names() -> tuple[str, ...]:
    """The built-in tables."""
    return tuple(sorted(item.name.removesuffix(".yaml") for item in _folder().iterdir() if item.name.endswith(".yaml")))


def load_table(name: str) -> ExperimentTable:
    """A built-in table by name, or one from a YAML file.

    Raises:
        TrainingError: there is none, or it breaks the rules.
    """
    if name in table_names():
        text = (_folder() / f"{name}.yaml").read_text(encoding="utf-8")
    elif Path(name).suffix in (".yaml", ".yml"):
        text = read_text(Path(name))
    else:
        raise TrainingError(f"no table {name!r}; choose among {', '.join(table_names())}, or give a YAML file")
    try:
        return ExperimentTable.model_validate(yaml.safe_load(text))
    except yaml.YAMLError as error:
        raise TrainingError(f"{name} is not YAML: {' '.join(str(error).split())}") from error
    except ValidationError as error:
        raise TrainingError(f"{name}: {first_problem(error)}") from error


def _folder() -> resources.abc.Traversable:  # type: ignore[name-defined]
    return resources.files("training.experiments") / "tables"

"""Parse the list of requested variants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cosim.drives.files import is_safe_name
from cosim.errors import CosimError
from sensors.effects.base import LabelEffect
from sensors.sensor_file import model_names
from sensors.sensor_model import SensorModel, load_sensor

PAPER = ("first_hit", "strongest", "strongest_star", "depth", "dual", "noise", "intensity", "raydrop")
"""The eight variants of "Synth It Like KITTI", selected by `all`."""


class VariantError(CosimError):
    """Variants cannot be made."""


@dataclass(frozen=True)
class Variant:
    """A sensor model for a variant.

    Attributes:
        stem: name of the variant's folder.
        sensor: sensor model.
    """

    stem: str
    sensor: SensorModel


def read_variants(text: str, annotator: Sequence[LabelEffect] = ()) -> tuple[Variant, ...]:
    """Parse a comma-separated list of built-in sensors, patterns and sensor files; `all` are the paper's eight.

    Args:
        text: the list.
        annotator: label effects for sensors that have none.

    Raises:
        VariantError: the list is empty, or two variants have the same folder.
        SensorError: a sensor does not exist or is invalid.
    """
    names = [name.strip() for part in text.split(",") for name in (PAPER if part.strip() == "all" else (part,))]
    names = [name for name in names if name]
    if not names:
        raise VariantError(
            f"--variant {text!r} names no sensor; give sensors separated by commas: {', '.join(model_names())}"
        )
    sensors = [load_sensor(name) for name in names]
    variants = tuple(
        Variant(Path(name).stem, sensor if sensor.relabels else sensor.with_annotator(annotator))
        for name, sensor in zip(names, sensors, strict=True)
    )
    stems = [variant.stem for variant in variants]
    for stem in stems:
        if stems.count(stem) > 1:
            raise VariantError(f"two variants would be written to {stem}/; rename one of the files, or name it once")
        if not is_safe_name(stem):
            raise VariantError(f"variant {stem!r} cannot name a folder; rename its file with letters, digits and _")
    return variants

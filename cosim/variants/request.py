"""Which variants are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cosim.drives.files import is_safe_name
from cosim.errors import CosimError
from sensors.sensor_file import model_names
from sensors.sensor_model import SensorModel, load_sensor

PAPER = ("first_hit", "strongest", "strongest_star", "depth", "dual", "noise", "intensity", "raydrop")
"""The eight of "Synth It Like KITTI", which `all` stands for."""


class VariantError(CosimError):
    """Variants cannot be made."""


@dataclass(frozen=True)
class Variant:
    """A sensor to measure a drive with.

    Attributes:
        stem: folder of its frames.
        sensor: the sensor.
    """

    stem: str
    sensor: SensorModel


def read_variants(text: str) -> tuple[Variant, ...]:
    """The variants of a list with commas: built-in sensors, patterns, sensor files, or `all` for the paper's eight.

    Raises:
        VariantError: the list is empty, or two would take one folder.
        SensorError: a sensor does not exist or breaks the format.
    """
    names = [name.strip() for part in text.split(",") for name in (PAPER if part.strip() == "all" else (part,))]
    names = [name for name in names if name]
    if not names:
        raise VariantError(
            f"--variant {text!r} names none; give sensors with commas between: {', '.join(model_names())}"
        )
    variants = tuple(Variant(Path(name).stem, load_sensor(name)) for name in names)
    stems = [variant.stem for variant in variants]
    for stem in stems:
        if stems.count(stem) > 1:
            raise VariantError(f"two variants would be written to {stem}/; rename one of the files, or name it once")
        if not is_safe_name(stem):
            raise VariantError(f"variant {stem!r} cannot name a folder; rename its file with letters, digits and _")
    return variants

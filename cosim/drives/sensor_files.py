"""Sensor files on disk, with what they name."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import yaml

from cosim.drives.writer import explained
from sensors.errors import SensorError
from sensors.pattern import Pattern, load_pattern, pattern_names
from sensors.sensor_model import SensorModel


def write_sensor(sensor: SensorModel, path: Path, plugins: Mapping[str, tuple[str, str]] | None = None) -> Path:
    """Write a sensor file that can be loaded from its folder; return its path.

    A pattern that is not built in is written next to it as `pattern.yaml`, or, if another pattern has that
    name, as `STEM.pattern.yaml`. Effects from files are named relative to the sensor file.

    Args:
        sensor: the model.
        path: of the sensor file; folders are made.
        plugins: class name and Python source of effects that have no file yet, by effect name; files are written.

    Raises:
        OutputError: the folder cannot be written.
    """
    values = yaml.safe_load(sensor.to_yaml())
    with explained(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        values["pattern"] = _write_pattern(sensor.pattern, path)
        for entry, effect in zip(values["effects"], sensor.effects, strict=True):
            if effect.name in (plugins or {}):
                name, source = (plugins or {})[effect.name]
                path.with_name(f"{effect.name}.py").write_text(source, encoding="utf-8", newline="\n")
                entry["effect"] = f"./{effect.name}.py:{name}"
            elif effect.source:
                file, _, name = effect.source.rpartition(":")
                entry["effect"] = f"{_relative(Path(file), path.parent)}:{name}"
        text = yaml.safe_dump(values, sort_keys=False, allow_unicode=True, width=110)
        path.write_text(text, encoding="utf-8", newline="\n")
    return path


def _write_pattern(pattern: Pattern, path: Path) -> str:
    """Write the pattern if necessary, and return the name by which the sensor file refers to it."""
    default = path.parent / "pattern.yaml"
    taken = default.is_file() and not _is(pattern, default)
    if pattern.name in pattern_names() and load_pattern(pattern.name) == pattern and not taken:
        return pattern.name
    own = path.with_name(f"{path.stem}.pattern.yaml") if taken else default
    own.write_text(pattern.to_yaml(), encoding="utf-8", newline="\n")
    return f"./{own.name}"


def _is(pattern: Pattern, path: Path) -> bool:
    try:
        return load_pattern(path) == pattern
    except SensorError:
        return False


def _relative(file: Path, folder: Path) -> str:
    text = Path(os.path.relpath(file, folder.resolve())).as_posix()
    return text if text.startswith("..") else f"./{text}"

"""Sensor files: `pattern:` and a list of `effects:`. Annotator files: a list of label effects."""

from __future__ import annotations

import logging
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from assets.documents import DocumentError, parse_yaml
from sensors.effects.base import Effect, LabelEffect
from sensors.effects.registry import find_effect
from sensors.errors import SensorError
from sensors.pattern import Pattern, first_problem, load_pattern, pattern_names
from sensors.sensor_model import SensorModel

_LOG = logging.getLogger(__name__)
_MODELS = files("sensors") / "models"
_ANNOTATORS = files("sensors") / "annotators"
_RENAMED = {"hdl64e_dual": "hdl64e_two_blocks"}  # read as dual return, which it has not
_KEYS = ("pattern", "effects")
EXACT_ANNOTATOR = "exact"
"""Name of the annotator that draws exact boxes."""


def model_names() -> list[str]:
    """Names of the built-in sensors."""
    return _names_in(_MODELS)


def annotator_names() -> list[str]:
    """Names of the built-in annotators; `exact` is the first."""
    return [EXACT_ANNOTATOR, *_names_in(_ANNOTATORS)]


def _names_in(folder: Traversable) -> list[str]:
    return sorted(file.name.removesuffix(".yaml") for file in folder.iterdir() if file.name.endswith(".yaml"))


def read_annotator(text: str, pattern: Pattern) -> tuple[LabelEffect, ...]:
    """Read the label effects of a built-in annotator or of a file with a list of `effects:`.

    Args:
        text: name or path.
        pattern: beams of the sensor whose scans are labelled.

    Raises:
        SensorError: no such file or annotator, it breaks the format, or an effect does not act on labels.
    """
    if text == EXACT_ANNOTATOR:
        return ()
    if text in annotator_names():
        values, folder = _parse((_ANNOTATORS / f"{text}.yaml").read_text(encoding="utf-8"), "annotator", text), Path()
    else:
        path = Path(text)
        if not path.is_file():
            raise SensorError(
                f"annotator {text!r} does not exist; give {', '.join(annotator_names())} or the path of a file"
            )
        values, folder = _parse(_read(path, "annotator"), "annotator", text), path.parent
    if not isinstance(values, dict) or set(values) != {"effects"}:
        raise SensorError(f"annotator {text}: write only a list of label effects, `effects: [...]`")
    effects = _parse_effects(values, origin=text, folder=folder, pattern=pattern, role="annotator")
    labelling = tuple(effect for effect in effects if isinstance(effect, LabelEffect))
    if len(labelling) < len(effects):
        other = next(effect.name for effect in effects if not isinstance(effect, LabelEffect))
        raise SensorError(f"annotator {text}: {other} does not change labels; write it into the sensor file")
    return labelling


def read_sensor(text: str) -> SensorModel:
    """A bare sensor of a pattern's name, a built-in sensor by name, or one from a file.

    Raises:
        SensorError: see `load_sensor`.
    """
    if text in pattern_names():
        return SensorModel(load_pattern(text), origin=text)
    if text in _RENAMED:
        _LOG.warning("sensor %s is called %s now; write that", text, _RENAMED[text])
        text = _RENAMED[text]
    if text in model_names():
        return parse_sensor((_MODELS / f"{text}.yaml").read_text(encoding="utf-8"), origin=text, folder=Path())
    path = Path(text)
    if not path.is_file():
        raise SensorError(
            f"sensor {text!r} does not exist; give the path of a sensor file, a sensor "
            f"({', '.join(model_names())}) or a pattern ({', '.join(pattern_names())})"
        )
    return parse_sensor(_read(path, "sensor"), origin=text, folder=path.parent)


def _read(path: Path, role: str) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SensorError(f"{role} {path} cannot be read: {' '.join(str(error).split())}") from error


def _parse(content: str, role: str, origin: str) -> Any:
    try:
        return parse_yaml(content)
    except DocumentError as error:
        raise SensorError(f"{role} {origin} cannot be read: {' '.join(str(error).split())}") from error


def parse_sensor(content: str, *, origin: str, folder: Path) -> SensorModel:
    """A sensor from the text of its file; paths in it are relative to `folder`.

    Raises:
        SensorError: the text breaks the format.
    """
    values = _parse(content, "sensor", origin)
    if not isinstance(values, dict) or not isinstance(values.get("pattern"), str):
        raise SensorError(f"sensor {origin} names no pattern; write `pattern: hdl64e`")
    unknown = sorted(str(key) for key in set(values) - set(_KEYS))
    if unknown:
        raise SensorError(f"sensor {origin}: unknown key {unknown[0]!r}; use pattern and effects")
    pattern = _pattern(values["pattern"], folder)
    return SensorModel(pattern, _parse_effects(values, origin=origin, folder=folder, pattern=pattern), origin)


def _parse_effects(
    values: dict[str, Any], *, origin: str, folder: Path, pattern: Pattern, role: str = "sensor"
) -> tuple[Effect, ...]:
    entries = values.get("effects") or []
    if not isinstance(entries, list):
        raise SensorError(f"{role} {origin}: effects is {entries!r}; give a list")
    effects = tuple(parse_effect(entry, origin=origin, folder=folder, pattern=pattern, role=role) for entry in entries)
    _check_doubles(effects, f"{role} {origin}")
    return effects


def _pattern(name: str, folder: Path) -> Pattern:
    """The pattern of a name or path; drives have their own next to the sensor file as `pattern.yaml`."""
    for beside in (folder / name, folder / "pattern.yaml"):
        if beside.is_file() and (beside.name == Path(name).name or load_pattern(beside).name == name):
            return load_pattern(beside)
    return load_pattern(name)


def parse_effect(entry: Any, *, origin: str, folder: Path, pattern: Pattern, role: str = "sensor") -> Effect:
    """One effect from `{effect: NAME, parameter: value, …}`.

    Raises:
        SensorError: unknown effect, unknown or missing parameter, value out of bounds or unfit for the pattern.
    """
    if isinstance(entry, str):
        entry = {"effect": entry}
    if not isinstance(entry, dict) or not isinstance(entry.get("effect"), str):
        raise SensorError(f"{role} {origin}: {entry!r} names no effect; write `{{effect: NAME, parameter: value}}`")
    name = entry["effect"]
    try:
        kind = find_effect(name, folder)
    except SensorError as error:
        raise SensorError(f"{role} {origin}: {error}") from error
    try:
        effect = kind.model_validate({key: value for key, value in entry.items() if key != "effect"})
        effect.check(pattern)
    except ValidationError as error:
        known = ", ".join(kind.model_fields) or "none"
        raise SensorError(f"{role} {origin}: effect {name}: {first_problem(error)}; parameters: {known}") from error
    except ValueError as error:
        raise SensorError(f"{role} {origin}: effect {name}: {error}") from error
    return effect


def _check_doubles(effects: tuple[Effect, ...], where: str) -> None:
    seen: set[str] = set()
    for effect in effects:
        if effect.name in seen and not effect.repeatable:
            raise SensorError(f"{where}: effect {effect.name} is listed twice; list it once with its total")
        seen.add(effect.name)

"""Registry of effects by name: built-in ones, installed ones, and those in a user's own file."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import MappingProxyType

import sensors.effects
from sensors.effects.base import BeamEffect, EchoEffect, Effect, LabelEffect, PointEffect, ScanEffect
from sensors.effects.blame import line_of
from sensors.errors import SensorError

GROUP = "cosim.effects"
_STAGES = (BeamEffect, EchoEffect, PointEffect, ScanEffect, LabelEffect)
_ELSEWHERE = {
    **dict.fromkeys(
        (
            "speeding",
            "short_gap",
            "lane_offset",
            "lane_changing",
            "u_turns",
            "parked_pull_out",
            "imperfection",
            "reaction_time",
        ),
        "traffic",
    ),
}


@cache
def built_in_effects() -> Mapping[str, type[Effect]]:
    """Built-in effects by name, in the order in which they act; a file put into one of the folders needs no entry.

    Raises:
        ValueError: two files define effects of one name.
    """
    found: dict[str, type[Effect]] = {}
    for effect in sorted(_defined_effects(), key=lambda effect: (effect.phase, effect.__module__.rpartition(".")[2])):
        if effect.name in found:
            raise ValueError(f"effect {effect.name!r} is in {found[effect.name].__module__} and {effect.__module__}")
        found[effect.name] = effect
    return MappingProxyType(found)


def _defined_effects() -> Iterator[type[Effect]]:
    """Effects with a name, each from the file that defines it."""
    for module_info in pkgutil.walk_packages(sensors.effects.__path__, "sensors.effects."):
        module = importlib.import_module(module_info.name)
        for value in vars(module).values():
            here = getattr(value, "__module__", "") == module.__name__
            if here and isinstance(value, type) and issubclass(value, Effect) and hasattr(value, "name"):
                yield value


def effect_classes() -> dict[str, type[Effect]]:
    """All built-in and installed effects by name, in the order in which they act.

    Raises:
        SensorError: an installed one does not load or takes a built-in name.
    """
    classes = dict(built_in_effects())
    for entry in entry_points(group=GROUP):
        try:
            loaded = entry.load()
        except Exception as error:
            raise SensorError(f"effect {entry.value}: {_reason(error)}; fix or uninstall it") from error
        found = _checked(loaded, entry.value)
        if found.name in classes:
            raise SensorError(f"effect {entry.value} takes the name {found.name!r}, which is in use; rename it")
        classes[found.name] = found
    return dict(sorted(classes.items(), key=lambda item: item[1].phase))


def find_effect(text: str, folder: Path = Path()) -> type[Effect]:
    """The effect of a name, or of `path.py:ClassName` relative to `folder`.

    Raises:
        SensorError: no such effect; a file that does not load or holds no effect of that name.
    """
    if ".py:" in text:
        return _from_file(text, folder)
    classes = effect_classes()
    if text in classes:
        return classes[text]
    if text in _ELSEWHERE:
        raise SensorError(
            f"effect {text!r} is of the {_ELSEWHERE[text]} stage and cannot be part of a sensor; "
            "it belongs under behaviour in the run's configuration (docs/configuration.md)"
        )
    if text.endswith(".py"):
        raise SensorError(f"effect {text!r} names no class of that file; write `{text}:ClassName`")
    close = get_close_matches(text, classes, n=3, cutoff=0.5)
    hint = f"did you mean {' or '.join(close)}?" if close else "`cosim effects` lists all"
    raise SensorError(f"effect {text!r} is unknown; {hint}")


def _from_file(text: str, folder: Path) -> type[Effect]:
    file, _, name = text.rpartition(":")
    path = (folder / file).resolve()
    if not path.is_file():
        raise SensorError(f"effect {text!r}: file {path} does not exist; give its path relative to the sensor file")
    # Pydantic looks annotations up in the module's entry of sys.modules.
    module_name = f"cosim_effect_{hashlib.sha256(path.read_bytes() + bytes(path)).hexdigest()[:16]}"
    module = sys.modules.get(module_name)
    if module is None:
        spec = importlib.util.spec_from_file_location(module_name, path)
        assert spec is not None and spec.loader is not None  # a .py file always has a loader
        module = sys.modules[module_name] = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except (Exception, SystemExit) as error:
            del sys.modules[module_name]
            line = line_of(error, path)
            location = f"{path}, line {line}," if line else f"{path}"
            raise SensorError(
                f"effect {text!r}: {location} does not load: {_reason(error)}; correct the file"
            ) from error
    if not hasattr(module, name):
        raise SensorError(f"effect {text!r}: {path} holds no {name!r}; name one of its classes after the colon")
    found = _checked(getattr(module, name), text)
    found.source = f"{path}:{name}"
    return found


def _checked(kind: object, origin: str) -> type[Effect]:
    """Return the class if it satisfies the rules of effects."""
    base = next((stage for stage in _STAGES if isinstance(kind, type) and issubclass(kind, stage)), None)
    if base is None or not isinstance(kind, type) or not issubclass(kind, Effect):
        names = ", ".join(stage.__name__ for stage in _STAGES)
        raise SensorError(f"effect {origin}: is no sensor effect; derive the class from one of {names}")
    if kind.stage != base.stage:
        raise SensorError(
            f"effect {origin}: stage {kind.stage!r} but derived from {base.__name__}; "
            f"leave out `stage` or derive it from the class of that stage"
        )
    if not isinstance(getattr(kind, "name", None), str) or not hasattr(kind, "channel"):
        raise SensorError(f"effect {origin}: `name` or `channel` is missing; write `name: ClassVar = ...` in the class")
    if kind.apply is base.apply:  # type: ignore[attr-defined]
        raise SensorError(f"effect {origin}: has no `apply`; define it as {base.__name__} says")
    return kind


def _reason(error: BaseException) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())}"

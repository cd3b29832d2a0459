"""All built-in effects of a LiDAR: those that the files of this folder and its subfolders define."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from functools import cache
from types import MappingProxyType

import sensors.effects
from sensors.effects.base import Effect


@cache
def built_in_effects() -> Mapping[str, type[Effect]]:
    """Built-in effects by name, in the order in which they act; a file put into one of the folders needs no entry.

    Raises:
        ValueError: two files define effects of one name.
    """
    found: dict[str, type[Effect]] = {}
    for effect in sorted(_defined(), key=lambda effect: (effect.phase, effect.__module__.rpartition(".")[2])):
        if effect.name in found:
            raise ValueError(f"effect {effect.name!r} is in {found[effect.name].__module__} and {effect.__module__}")
        found[effect.name] = effect
    return MappingProxyType(found)


def _defined() -> Iterator[type[Effect]]:
    """Effects with a name, each from the file that defines it."""
    for module_info in pkgutil.walk_packages(sensors.effects.__path__, "sensors.effects."):
        module = importlib.import_module(module_info.name)
        for value in vars(module).values():
            here = getattr(value, "__module__", "") == module.__name__
            if here and isinstance(value, type) and issubclass(value, Effect) and hasattr(value, "name"):
                yield value

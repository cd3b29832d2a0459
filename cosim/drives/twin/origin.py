"""Local origins of twins: what is added to their coordinates to get those of the network's files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cosim.drives.files import read_mapping
from cosim.errors import FormatError

_AXES = ("x", "y", "z")


def read_origins(base: Path) -> dict[str, np.ndarray]:
    """Offsets (3,) float64 [m] by town from `twin/origin.yaml`; under "" where it has one town. None without a file.

    Raises:
        FormatError: the file is no YAML, or an offset is no number.
    """
    path = base / "twin/origin.yaml"
    if not path.is_file():
        return {}
    content = read_mapping(path)
    towns = content.get("towns", {"": content})
    if not isinstance(towns, Mapping):
        raise FormatError(f"{path}: towns is {towns!r}; give x, y, z by town")
    return {str(name): _offset(values, path) for name, values in towns.items()}


def _offset(values: object, path: Path) -> np.ndarray:
    numbers = [values.get(axis) for axis in _AXES] if isinstance(values, Mapping) else [None]
    if not all(isinstance(value, int | float) and np.isfinite(value) for value in numbers):
        raise FormatError(f"{path}: {values!r}; give x, y and z in metres")
    return np.array(numbers, np.float64)

"""Numbers on their way into and out of JSON, checked, with errors that name the place."""

from __future__ import annotations

from typing import Any

import numpy as np

from cosim.drives.files import is_safe_name, is_safe_path
from cosim.errors import FormatError

_LENGTH_DECIMALS, _ROTATION_DECIMALS = 6, 9
_ROTATION_TOLERANCE = 1e-3


def number_json(value: float) -> float:
    """A number to 1e-6, without a negative zero."""
    return round(float(value), _LENGTH_DECIMALS) + 0.0


def vector_json(vector: np.ndarray) -> list[Any]:
    """Vectors (…, n) to 1e-6, without negative zeros."""
    return (np.round(np.asarray(vector, np.float64), _LENGTH_DECIMALS) + 0.0).tolist()


def matrix_json(matrix: np.ndarray) -> list[Any]:
    """Matrices (…, 3, 4) or (…, 4, 4): last column to 1e-6, the others to 1e-9, without negative zeros."""
    rounded = np.round(np.asarray(matrix, np.float64), _ROTATION_DECIMALS)
    rounded[..., 3] = np.round(np.asarray(matrix, np.float64)[..., 3], _LENGTH_DECIMALS)
    return (rounded + 0.0).tolist()


class Reader:
    """A JSON object with typed access to its values; every error names file, key, value and rule."""

    def __init__(self, value: Any, where: str) -> None:
        if not isinstance(value, dict):
            raise FormatError(f"{where}: expected an object, found {_short(value)}")
        self._values: dict[str, Any] = value
        self._where = where

    @property
    def where(self) -> str:
        """File and place, for messages."""
        return self._where

    def value(self, key: str) -> Any:
        """Value of a key, unchecked."""
        return self._get(key)

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of the object."""
        return tuple(self._values)

    def child(self, key: str) -> Reader:
        """The object under a key."""
        return Reader(self._get(key), f"{self._where}: {key}")

    def children(self, key: str) -> list[Reader]:
        """The objects of the list under a key."""
        value = self._get(key)
        if not isinstance(value, list):
            raise self._wrong(key, "a list")
        return [Reader(entry, f"{self._where}: {key}[{row}]") for row, entry in enumerate(value)]

    def text(self, key: str) -> str:
        """The text under a key."""
        value = self._get(key)
        if not isinstance(value, str):
            raise self._wrong(key, "text")
        return value

    def name(self, key: str) -> str:
        """The text under a key, fit to be part of a file name."""
        if not is_safe_name(self.text(key)):
            raise self._wrong(key, "a plain file name without folders")
        return self.text(key)

    def path(self, key: str) -> str:
        """The text under a key, a path that stays inside its folder."""
        if not is_safe_path(self.text(key)):
            raise self._wrong(key, "a relative path inside twin/")
        return self.text(key)

    def number(self, key: str, above: float | None = None) -> float:
        """The finite number under a key."""
        value = self._get(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < float("inf"):
            raise self._wrong(key, "a finite number")
        if above is not None and value <= above:
            raise self._wrong(key, f"a number above {above}")
        return float(value)

    def array(self, key: str, shape: tuple[int, ...]) -> np.ndarray:
        """The finite float64 array of a given shape under a key."""
        kind = "numbers of shape " + " × ".join(map(str, shape))
        try:
            array = np.array(self._get(key))
        except ValueError:
            raise self._wrong(key, kind) from None
        if array.shape != shape or array.dtype.kind not in "fi":
            raise self._wrong(key, kind)
        if not np.isfinite(array).all():
            raise self._wrong(key, "finite " + kind)
        return array.astype(np.float64)

    def pose(self, key: str) -> np.ndarray:
        """The (4, 4) rigid motion under a key."""
        matrix = self.array(key, (4, 4))
        rotation = matrix[:3, :3]
        rigid = np.abs(rotation @ rotation.T - np.eye(3)).max() < _ROTATION_TOLERANCE  # allclose is ten times slower
        if not rigid or np.linalg.det(rotation) < 0 or matrix[3].tolist() != [0, 0, 0, 1]:
            raise self._wrong(key, "a rotation, a translation and the row 0 0 0 1")
        return matrix

    def _get(self, key: str) -> Any:
        if key not in self._values:
            raise FormatError(f"{self._where}: missing {key!r}; it has {', '.join(self._values) or 'nothing'}")
        return self._values[key]

    def _wrong(self, key: str, expected: str) -> FormatError:
        return FormatError(f"{self._where}: {key} is {_short(self._values[key])}; expected {expected}")


def arrays(entries: list[Reader], key: str, shape: tuple[int, ...]) -> np.ndarray:
    """Read an array of each entry at once, (n, …) float64, because a frame has hundreds."""
    values = [entry._values.get(key) for entry in entries]
    try:
        stacked = np.array(values)
    except ValueError:
        stacked = np.empty(0)
    sound = stacked.shape == (len(entries), *shape) and stacked.dtype.kind in "fi" and np.isfinite(stacked).all()
    if sound and not any(isinstance(value, bool) for value in values):
        return stacked.astype(np.float64)
    one_by_one = [entry.array(key, shape) if shape else entry.number(key) for entry in entries]  # names the fault
    return np.array(one_by_one, np.float64).reshape(len(entries), *shape)


def positives(entries: list[Reader], key: str) -> list[float]:
    """Numbers above 0, one of each entry."""
    values = arrays(entries, key, ())
    return values.tolist() if (values > 0).all() else [entry.number(key, above=0) for entry in entries]


def poses(entries: list[Reader], key: str) -> np.ndarray:
    """Read the pose of each entry, (n, 4, 4) float64."""
    matrices = arrays(entries, key, (4, 4))
    rotation = matrices[:, :3, :3]
    off = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max(initial=0)
    rigid = off < _ROTATION_TOLERANCE and (np.linalg.det(rotation) > 0).all()
    if not rigid or (matrices[:, 3] != [0, 0, 0, 1]).any():
        return np.array([entry.pose(key) for entry in entries])
    return matrices


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."

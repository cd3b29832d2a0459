"""Errors of user-defined effects: one line with the file and the line number."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from sensors.effects.base import Effect
from sensors.errors import SensorError


@contextmanager
def blamed(effect: Effect, origin: str) -> Iterator[None]:
    """Wrap errors of a user's effect in one line that names its file; errors of built-in effects stay as they are.

    Raises:
        SensorError: the effect raised an error.
    """
    try:
        yield
    except SensorError:
        raise
    except Exception as error:
        if not effect.source:
            raise
        message = f"{type(error).__name__}: {' '.join(str(error).split())}"
        where = f"{effect.source}, line {line_of(error, file_of(effect)) or _line_of_method(effect)}"
        raise _error(effect, origin, where, f"raised {message}; correct the effect") from error


def broken(effect: Effect, origin: str, what: str, method: str = "apply") -> SensorError:
    """Return the error of an effect whose method gave a wrong result."""
    return _error(effect, origin, f"{effect.source}, line {_line_of_method(effect, method)}", what)


def check_values(effect: Effect, what: str, values: object, count: int, low: float = -np.inf) -> None:
    """Check an array, or one number for all, that a user's effect predicts.

    Args:
        effect: whose values they are; those of built-in effects are not checked.
        what: the name of the method.
        values: (count,) numbers, or one.
        count: number of returns or beams.
        low: the lowest allowed value.

    Raises:
        SensorError: another shape, NaN, infinity, or a value below `low`.
    """
    if not effect.source:
        return
    shape = np.shape(values)  # type: ignore[arg-type]
    if shape not in ((), (count,)):
        raise broken(effect, "", f"gave {what} of shape {shape}; give ({count},)", what)
    if not is_finite(values):
        raise broken(effect, "", f"gave NaN or infinity in {what}; keep it finite", what)
    if np.size(values) and float(np.min(np.asarray(values, float))) < low:  # type: ignore[arg-type]
        raise broken(effect, "", f"gave {what} below {low:g}; keep it at or above", what)


def is_finite(values: object) -> bool:
    """Whether values are numbers, and none of them NaN or infinite."""
    array = np.asarray(values)
    return array.dtype.kind in "biuf" and bool(np.isfinite(array).all())


def file_of(effect: Effect) -> str:
    """Path of the file of a user's effect."""
    return effect.source.rpartition(":")[0]


def line_of(error: BaseException, path: str | Path) -> int:
    """Line of a file in which an error arose; 0 where it arose elsewhere."""
    if isinstance(error, SyntaxError) and error.lineno and error.filename in (str(path), None):
        return error.lineno
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    return int(lines[-1] or 0) if lines else 0


def _error(effect: Effect, origin: str, where: str, what: str) -> SensorError:
    sensor = f"sensor {origin}: " if origin else ""
    return SensorError(f"{sensor}effect {effect.name} ({where}) {what}")


def _line_of_method(effect: Effect, method: str = "") -> int:
    """Line at which a method starts in the effect's file, or `error`, or the class."""
    for name in (method, "error", "apply", "kept", "spread", "factors"):
        code = getattr(vars(type(effect)).get(name), "__code__", None)
        if code is not None and code.co_filename == file_of(effect):
            return int(code.co_firstlineno)
    try:
        return inspect.getsourcelines(type(effect))[1]
    except (OSError, TypeError):
        return 1

"""Spoils files and tries their readers."""

from __future__ import annotations

import signal
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cosim.user_errors import user_errors
from tests.fuzz.readers import Reader
from training.errors import TrainingError

_LONGEST_S = 30.0
_REFUSALS = (*user_errors(), TrainingError)


@dataclass
class Tally:
    """What came of a reader's trials.

    Attributes:
        tried: spoilt files.
        refused: of those, how many it refused as it should; the rest it could still read.
        slowest_s: the longest trial [s].
        crashes: of each unexpected error, where it was raised and the seed of its trial.
    """

    tried: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    crashes: dict[str, int] = field(default_factory=dict)


def try_reader(reader: Reader, folder: Path, trials: int, seed: int = 0) -> Tally:
    """Have a reader read so many spoilt files.

    Args:
        reader: which.
        folder: the material; left as it was.
        trials: how many.
        seed: of the first; each trial has its own.
    """
    path = folder / reader.file
    whole = path.read_bytes()
    reader.read(path)
    tally = Tally()
    try:
        for trial in range(seed, seed + trials):
            path.write_bytes(reader.spoil(whole, np.random.default_rng(trial)))
            started = time.monotonic()
            _try(reader, path, trial, tally)
            tally.slowest_s = max(tally.slowest_s, time.monotonic() - started)
    finally:
        path.write_bytes(whole)
    return tally


def _try(reader: Reader, path: Path, trial: int, tally: Tally) -> None:
    tally.tried += 1
    try:
        with _limited():
            reader.read(path)
    except _REFUSALS as error:
        tally.refused += 1
        if "\n" in str(error):
            tally.crashes.setdefault(f"a message of several lines: {error!r}", trial)
    except Exception as error:  # noqa: BLE001 — any exception is reported
        frame = traceback.extract_tb(error.__traceback__)[-1]
        ours = [entry for entry in traceback.extract_tb(error.__traceback__) if "site-packages" not in entry.filename]
        where = f"{Path(ours[-1].filename).name}:{ours[-1].lineno}, {Path(frame.filename).name}:{frame.lineno}"
        key = f"{type(error).__name__} ({where})"
        if not any(crash.startswith(key) for crash in tally.crashes):
            tally.crashes[f"{key}: {str(error)[:100]}"] = trial


@contextmanager
def _limited() -> Iterator[None]:
    """Raise where the time is used up."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"took longer than {_LONGEST_S:g} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, _LONGEST_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)

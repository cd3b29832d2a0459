"""The error of every sensor file that was tried on a recording: `history.json`."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from cosim.drives.files import read_text
from cosim.drives.writer import explained
from cosim.errors import FormatError
from cosim.recordings.calibration.rounds import Round

FILE = "history.json"


@dataclass(frozen=True)
class Tried:
    """One sensor file on this recording, on a map made of points with its effects undone.

    Attributes:
        sensor: the file, relative to the calibration's folder.
        sha256: of its effects.
        effects: their names.
        error, error_aligned, noise_floor: on scans that took no part.
        thickness_ground_m, thickness_walls_m, held_out_m: of the map.
    """

    sensor: str
    sha256: str
    effects: list[str]
    error: float
    error_aligned: float
    noise_floor: float | None
    thickness_ground_m: float
    thickness_walls_m: float
    held_out_m: float | None


def noted(folder: Path, rounds: Sequence[Round]) -> tuple[Tried, ...]:
    """Add the sensors of these rounds to the history of all attempts, and write the file again."""
    known = {(one.sensor, one.sha256): one for one in read_history(folder)}
    for one in rounds:
        tried = _tried(one)
        known[tried.sensor, tried.sha256] = tried
    found = tuple(known.values())
    with explained(folder):
        new = folder / f"{FILE}.new"
        new.write_text(json.dumps([asdict(one) for one in found], indent=2) + "\n", encoding="utf-8")
        new.replace(folder / FILE)
    return found


def read_history(folder: Path) -> tuple[Tried, ...]:
    """Read the history of earlier attempts.

    Raises:
        FormatError: the file is damaged.
    """
    file = folder / FILE
    if not file.is_file():
        return ()
    try:
        return tuple(Tried(**one) for one in json.loads(read_text(file)))
    except (ValueError, TypeError) as error:
        raise FormatError(f"{file}: {error}; remove it to start a new history") from None


def _tried(one: Round) -> Tried:
    content = json.dumps(one.effects, sort_keys=True).encode()
    return Tried(
        sensor=one.sensor,
        sha256=hashlib.sha256(content).hexdigest()[:16],
        effects=[str(effect["effect"]) for effect in one.effects],
        error=one.error,
        error_aligned=one.error_aligned,
        noise_floor=one.noise_floor,
        thickness_ground_m=one.thickness_ground_m,
        thickness_walls_m=one.thickness_walls_m,
        held_out_m=one.held_out_m,
    )

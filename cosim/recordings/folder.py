"""Scans of a folder: files, order and times."""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path

import numpy as np

from cosim.drives.files import numbers, read_text
from cosim.recordings.reading import SUFFIXES, suffix_of
from cosim.recordings.scan import RecordingError

_USUAL = ("velodyne", "velodyne_points/data", "velodyne_points", "lidar", "points", "scans", "pcd", "training/velodyne")
_BESIDE = ("times.txt", "timestamps.txt")
_EPOCH_DIGITS = {13: 1e-3, 16: 1e-6, 17: 1e-6, 18: 1e-9, 19: 1e-9}  # digits of a stamp in a name → its unit [s]
_LEAST_EPOCH_DIGITS = min(_EPOCH_DIGITS)
_MOST_STEP = 5  # of the numbers of scans that follow each other
_LEAST_SHARE = 0.6  # of the time that a gap in the numbers of scans takes at their usual interval


def find_scans(root: Path, pattern: str | None = None) -> tuple[Path, ...]:
    """The files of a folder's scans in natural order: the folder's own, or those of the one below that has any.

    Args:
        root: the folder.
        pattern: which files, as `raw_*.bin`; all that a reader knows by default.

    Raises:
        RecordingError: none, several folders or several formats of scans.
    """
    here = _scans_in(root, pattern)
    if not here:
        usual = [root / name for name in _USUAL if (root / name).is_dir() and _scans_in(root / name, pattern)]
        below = usual[:1] or [item for item in sorted(root.iterdir()) if item.is_dir() and _scans_in(item, pattern)]
        if len(below) > 1:
            raise RecordingError(f"{root}: scans in {_named(below)}; give one of these folders")
        here = _scans_in(below[0], pattern) if below else ()
    if not here:
        wanted = f"that match {pattern!r}" if pattern else f"({', '.join(SUFFIXES)}, bags, .pcap, .osf)"
        raise RecordingError(f"{root}: no scans {wanted}; give the folder that holds them")
    types = {suffix: sum(suffix_of(file) == suffix for file in here) for suffix in {suffix_of(file) for file in here}}
    if len(types) > 1:
        held = ", ".join(f"{count} {kind}" for kind, count in sorted(types.items()))
        raise RecordingError(f"{here[0].parent}: files of several formats ({held}); say which are scans with --scans")
    return here


def natural_order(name: str) -> list[tuple[int, int, str]]:
    """A key that sorts numbers in names by value."""
    return [(0, int(part), "") if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", name) if part]


def find_stamps(root: Path, files: tuple[Path, ...]) -> np.ndarray | None:
    """Times of the scans (n,) [s]: from `times.txt` or `timestamps.txt` next to them, or from their names.

    Where such a file has not one line for each scan, as in KITTI's raw drives with missing scans, the number in its
    name chooses its line. Times in names are seconds since 1970.

    Raises:
        RecordingError: the lines of such a file cannot be assigned to scans, names and times contradict each other, or
            a line is no time.
    """
    folder = files[0].parent
    for path in dict.fromkeys((folder, folder.parent, root)):
        for name in _BESIDE:
            if (path / name).is_file():
                return _listed(path / name, files)
    found = [max(re.findall(r"\d+", file.name) or [""], key=len) for file in files]
    digits = {len(number) for number in found}
    if len(digits) == 1 and digits <= _EPOCH_DIGITS.keys() and len(files) > 1:
        return np.array([int(number) for number in found], np.float64) * _EPOCH_DIGITS[digits.pop()]
    return None


def name_numbers(names: tuple[str, ...]) -> np.ndarray | None:
    """(n,) numbers of scans that their names count, also where some are missing; None where names count no scans.

    Names count scans if their last numbers rise, mostly by five at most.
    """
    last = [re.findall(r"\d+", name) for name in names]
    if len(names) < 2 or not all(last) or max(len(found[-1]) for found in last) >= _LEAST_EPOCH_DIGITS:
        return None
    numbers_ = np.array([int(found[-1]) for found in last])
    steps = np.diff(numbers_)
    return numbers_ if steps.min() >= 1 and np.median(steps) <= _MOST_STEP else None


def numbered_rows(names: tuple[str, ...], count: int) -> np.ndarray | None:
    """Row of each scan in a list of all scans that were taken, by the number in its name.

    None where that cannot be: the numbers that are missing must explain the difference, so that the last number is that
    of the last row, or some are missing between the first row and the last scan.

    Args:
        names: of the scans; scans may be missing.
        count: rows of the list, one for every scan that was taken.
    """
    counted = name_numbers(names)
    if counted is None:
        return None
    rows = counted - (counted[-1] == count)  # counted from 1
    explained = rows[-1] == count - 1 or (rows[0] == 0 and rows[-1] >= len(rows))
    return rows if explained and rows[0] >= 0 and rows[-1] < count else None


def _listed(file: Path, files: tuple[Path, ...]) -> np.ndarray:
    """Times of the scans; the numbers in their names and the times themselves choose the lines where counts differ.

    Raises:
        RecordingError: names and times contradict each other, no line for a scan, or a line is no time.
    """
    lines = [line.strip() for line in read_text(file).rstrip().splitlines()]
    given = np.array([row for row, line in enumerate(lines) if line], int)  # an empty line stands for a missing scan
    stamps = np.array([_seconds(lines[row], f"{file}:{row + 1}") for row in given])
    counted = name_numbers(tuple(file.name for file in files))
    candidates = [np.arange(len(files))] if len(stamps) == len(files) else []
    if counted is not None and len(stamps) > 1:
        for number in (given, _turns(stamps)):
            candidates += [_places(counted - first, number) for first in dict.fromkeys((0, 1, counted[0]))]
    rows = [found for found in candidates if found is not None]
    if not rows:
        raise RecordingError(
            f"{file}: {len(stamps)} times for {len(files)} scans, and not every scan ({files[0].name} to "
            f"{files[-1].name}) has a time by the number in its name; give one time a scan, or a line for each number, "
            "or remove the file"
        )
    if counted is None:
        return stamps[rows[0]]
    steps = np.diff(counted)
    best = min(rows, key=lambda found: np.abs(_intervals(steps, stamps[found]) - steps).round().sum())
    share = np.where(steps > np.median(steps), _intervals(steps, stamps[best]) / steps, 1.0)
    if share.min() < _LEAST_SHARE:
        row = int(share.argmin())
        raise RecordingError(
            f"{file}: by their names, scans {files[row].name} and {files[row + 1].name} are "
            f"{steps[row]} intervals apart, by their times "
            f"{stamps[best][row + 1] - stamps[best][row]:.3f} s, too short for that; correct the times, or remove the "
            "file to go by the names"
        )
    return stamps[best]


def _turns(stamps: np.ndarray) -> np.ndarray:
    """(n,) number of each time, counted in usual intervals from the first."""
    steps = np.diff(stamps)
    usual = float(np.median(steps))
    return np.append(0, np.cumsum(np.rint(steps / usual))).astype(int) if usual > 0 else np.arange(len(stamps))


def _places(wanted: np.ndarray, numbers_: np.ndarray) -> np.ndarray | None:
    """Where each wanted number is in increasing numbers; None if one is not there."""
    places = np.searchsorted(numbers_, wanted)
    if np.any(np.diff(numbers_) <= 0) or places[-1] >= len(numbers_) or np.any(numbers_[places] != wanted):
        return None
    return places


def _intervals(steps: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """(n - 1,) usual intervals from scan to scan by their times, the interval being that of one number in names."""
    gained = np.diff(stamps)
    usual = float(np.median(gained / steps))
    return gained / usual if usual > 0 else steps.astype(float)


def _seconds(line: str, where: str) -> float:
    """Seconds of a number, or of a date as KITTI writes it (nanoseconds behind the point)."""
    if ":" not in line:
        return numbers(line.split()[:1], where)[0]
    try:
        whole, _, part = line.partition(".")
        return datetime.fromisoformat(whole + "+00:00").timestamp() + float(f"0.{part or 0}")
    except ValueError:
        raise RecordingError(f"{where}: {line!r} is no time; write seconds, or 2011-09-26 13:02:44.3") from None


def _scans_in(folder: Path, pattern: str | None) -> tuple[Path, ...]:
    files = (item for item in folder.glob(pattern or "*") if item.is_file() and suffix_of(item))
    return tuple(sorted(files, key=lambda file: natural_order(file.name)))


def _named(folders: list[Path]) -> str:
    return ", ".join(folder.name for folder in folders[:6]) + (" …" if len(folders) > 6 else "")

"""Where the scans of a folder lie, in which order, and when they were taken."""

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

    Where such a file has more lines than there are scans, as KITTI's raw drives with missing scans, the number in a
    scan's name chooses its line. Times in names are seconds since 1970.

    Raises:
        RecordingError: the lines of such a file cannot be assigned to scans, or a line is no time.
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


def numbered_rows(files: tuple[Path, ...] | tuple[str, ...], count: int) -> np.ndarray | None:
    """Row of each scan in a list of all scans that were taken, by the number in its name.

    None where that cannot be: the number of the last scan must be that of the last row, so that the numbers that are
    missing explain the difference.

    Args:
        files: scans, or their names; scans may be missing.
        count: rows of the list, one for every scan that was taken.
    """
    names = [file.name if isinstance(file, Path) else file for file in files]
    last = [re.findall(r"\d+", name) for name in names]
    if not all(last):
        return None
    rows = np.array([int(numbers_[-1]) if len(numbers_[-1]) < 10 else -1 for numbers_ in last])
    if len(rows) == 0 or rows.min() < 0 or np.any(np.diff(rows) <= 0) or rows.max() != count - 1:
        return None
    return rows


def _listed(file: Path, files: tuple[Path, ...]) -> np.ndarray:
    lines = [line.strip() for line in read_text(file).splitlines() if line.strip()]
    stamps = np.array([_seconds(line, f"{file}:{row}") for row, line in enumerate(lines, 1)])
    if len(lines) == len(files):
        return stamps
    rows = numbered_rows(files, len(lines)) if len(lines) > len(files) else None
    if rows is None:
        raise RecordingError(
            f"{file}: {len(lines)} times for {len(files)} scans, and the numbers in the names of the scans "
            f"({files[0].name} to {files[-1].name}) do not say which are missing; give one time a scan, or remove the "
            f"file"
        )
    return stamps[rows]


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

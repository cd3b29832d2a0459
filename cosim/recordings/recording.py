"""`Recording`: scans in order, from a folder, a bag or a capture, read one at a time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.errors import CosimError
from cosim.point_files import Columns, PointSchema, find_schema, make_scan
from cosim.recordings.folder import find_scans, find_stamps, name_numbers
from cosim.recordings.poses import find_poses, read_poses
from cosim.recordings.reading import (
    PACKET_SUFFIXES,
    Source,
    bag_sources,
    file_sources,
    is_bag,
    packet_sources,
    suffix_of,
)
from cosim.recordings.scan import RecordingError, Scan, recording_errors
from cosim.recordings.settings import RecordingSettings, read_settings

_SAMPLES = 5  # scans used to infer units and fields
_GAP = 1.5  # times the usual interval between scans
_SHOWN = 8  # names in a note
_LABELS = ("label_2", "tracking_labels.txt", "labels")


@dataclass(frozen=True, eq=False)
class Recording:
    """Scans of one sensor, in order of time. `recording[3]` reads the fourth; iterating reads one after the other.

    Attributes:
        path: as given.
        sources: where each scan lies.
        schema: meaning of the columns of the files, and their units and axes.
        settings: what the user said.
        stamp_s: (n,) when each was taken, from any epoch [s]; None where nothing says so.
        poses: (n, 4, 4) of the sensor in the axes of its first pose; None where there are none.
        notes: what was guessed, is missing or looks wrong, a sentence each.
    """

    path: Path
    sources: tuple[Source, ...]
    schema: PointSchema
    settings: RecordingSettings
    stamp_s: np.ndarray | None = None
    poses: np.ndarray | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.sources)

    def __iter__(self) -> Iterator[Scan]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> Scan:
        """Read a scan.

        Raises:
            RecordingError: its file is damaged.
        """
        source = self.sources[number]
        stamp = None if self.stamp_s is None else float(self.stamp_s[number])
        columns = _columns(source)
        with recording_errors():
            return make_scan(columns, source.name, self.schema, stamp)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the scans."""
        return tuple(source.name for source in self.sources)

    @property
    def interval_s(self) -> float | None:
        """Median time from scan to scan [s]; None if it is unknown."""
        if self.stamp_s is None or len(self) < 2:
            return None
        return float(np.median(np.diff(self.stamp_s)))

    def turns(self, sweep_s: float) -> np.ndarray:
        """(n,) sweeps since the first scan: from stamps, else from the numbers in names, else one a scan."""
        if self.stamp_s is not None:
            return (self.stamp_s - self.stamp_s[0]) / sweep_s
        numbers = name_numbers(self.names)
        return np.arange(len(self), dtype=float) if numbers is None else (numbers - numbers[0]).astype(float)

    def gaps(self) -> tuple[int, ...]:
        """Numbers of the scans before which time is missing."""
        usual = self.interval_s
        if usual is None or self.stamp_s is None or len(self) < 3:
            return ()
        return tuple(int(row) + 1 for row in np.flatnonzero(np.diff(self.stamp_s) > _GAP * usual))

    def between(self, first: int, last: int) -> Recording:
        """The scans of an interval, the last excluded."""
        rows = slice(first, last)
        return replace(
            self,
            sources=self.sources[rows],
            stamp_s=None if self.stamp_s is None else self.stamp_s[rows],
            poses=None if self.poses is None else self.poses[rows],
        )

    def chosen(self, rows: np.ndarray) -> Recording:
        """Some of the scans."""
        return replace(
            self,
            sources=tuple(self.sources[row] for row in rows),
            stamp_s=None if self.stamp_s is None else self.stamp_s[rows],
            poses=None if self.poses is None else self.poses[rows],
        )

    def without_poses(self) -> Recording:
        """Return the recording without its poses."""
        return replace(self, poses=None)


def open_recording(path: str | Path, **options: object) -> Recording:
    """Find the scans of a recording, their units, stamps and poses.

    Args:
        path: a folder of scans, one file of them, a bag, an Ouster capture.
        options: fields of RecordingSettings, which go before those of `recording.yaml`.

    Raises:
        RecordingError: no scans, several formats or topics, different fields from scan to scan, or a damaged file.
        FormatError: a file cannot be read.
    """
    file = Path(path)
    if not file.exists():
        raise RecordingError(f"{file}: no such file or folder; give a folder of scans, a bag or a capture")
    settings = read_settings(file).with_options(**options)
    sources, stamp_s = _sources(file, settings)
    readable, damaged = _readable(sources) if settings.skip_damaged else (np.arange(len(sources)), [])
    if not len(readable):
        raise RecordingError(f"{file}: none of {len(sources)} scans can be read; {damaged[0]}")
    samples = _samples(tuple(sources[row] for row in readable))
    with recording_errors():
        schema = find_schema([columns for _, columns in samples], settings.points, str(file))
    recording = Recording(file, sources, schema, settings, stamp_s)
    poses, pose_notes = _poses(recording)
    recording = replace(recording, poses=poses).chosen(readable)
    return replace(recording, notes=(*schema.notes, *pose_notes, *damaged, *_absences(recording, samples)))


def _columns(source: Source) -> Columns:
    """The columns of a scan.

    Raises:
        RecordingError: it cannot be read.
    """
    try:
        return source.read()
    except CosimError as error:
        raise RecordingError(f"{error}; or leave such scans out with --skip-damaged") from None


def _readable(sources: tuple[Source, ...]) -> tuple[np.ndarray, list[str]]:
    """Rows of the scans that can be read and have the usual fields, and a note on the others."""
    fields, reasons = dict[int, frozenset[str]](), dict[int, str]()
    for row, source in enumerate(sources):
        try:
            with recording_errors():
                fields[row] = frozenset(source.read())
        except CosimError as error:
            reasons[row] = str(error)
    usual = Counter(fields.values()).most_common(1)[0][0] if fields else frozenset()
    reasons |= {row: f"{sources[row].name}: other fields" for row, own in fields.items() if own != usual}
    if not reasons:
        return np.arange(len(sources)), []
    rows = np.array([row for row in range(len(sources)) if row not in reasons], int)
    names = ", ".join(sources[row].name for row in sorted(reasons)[:_SHOWN])
    more = " …" if len(reasons) > _SHOWN else ""
    first = reasons[min(reasons)]
    note = f"{len(reasons)} of {len(sources)} scans cannot be read and are left out: {names}{more} ({first})"
    return rows, [note]


def _sources(folder: Path, settings: RecordingSettings) -> tuple[tuple[Source, ...], np.ndarray | None]:
    if is_bag(folder):
        sources = bag_sources(folder, settings.topic)
    elif folder.is_file() and folder.suffix.lower() in PACKET_SUFFIXES:
        sources = packet_sources(folder)
    elif folder.is_file():
        if not suffix_of(folder):
            raise RecordingError(f"{folder}: no reader for {folder.suffix or 'such files'}; see docs/recordings.md")
        sources = file_sources([folder], settings.points)
    else:
        files = find_scans(folder, settings.scans)
        return file_sources(files, settings.points), _rising(find_stamps(folder, files), folder)
    if not sources:
        raise RecordingError(f"{folder}: holds no scan; record longer")
    stamps = np.array([source.stamp_s for source in sources], np.float64)
    return sources, _rising(None if np.isnan(stamps).any() else stamps, folder)


def _rising(stamp_s: np.ndarray | None, folder: Path) -> np.ndarray | None:
    if stamp_s is not None and np.any(np.diff(stamp_s) <= 0):
        row = int(np.argmax(np.diff(stamp_s) <= 0)) + 1
        raise RecordingError(
            f"{folder}: scan {row} is stamped no later than the one before; put scans in order of time"
        )
    return stamp_s


def _samples(sources: tuple[Source, ...]) -> list[tuple[str, Columns]]:
    rows = np.unique(np.linspace(0, len(sources) - 1, min(_SAMPLES, len(sources))).round().astype(int))
    found = [(sources[row].name, _columns(sources[row])) for row in rows]
    first = set(found[0][1])
    for name, columns in found[1:]:
        if set(columns) != first:
            raise RecordingError(
                f"scans {found[0][0]} and {name} have different fields ({', '.join(sorted(first))} and "
                f"{', '.join(sorted(columns))}), as of several sensors; give the scans of one, as with --scans"
            )
    return found


def _poses(recording: Recording) -> tuple[np.ndarray | None, list[str]]:
    file = find_poses(recording.path, recording.settings.poses)
    if file is None:
        return None, []
    poses, note = read_poses(file, len(recording), recording.stamp_s, recording.names)
    return poses, [note]


def _absences(recording: Recording, samples: list[tuple[str, Columns]]) -> list[str]:
    notes = []
    with recording_errors():
        scan = make_scan(samples[0][1], samples[0][0], recording.schema)
    if not len(scan):
        notes.append(f"scan {scan.name} holds no point")
    if scan.intensity is None:
        notes.append("no intensities: reflectances and attenuation cannot be determined")
    if not recording.schema.is_frame_checked:
        notes.append(
            "left and right cannot be verified: the points show no sense of rotation, or no ground; x y z are assumed "
            "forward, left and up; use --flip-y or --axes otherwise"
        )
    if recording.stamp_s is None:
        notes.append("no stamps: scans are assumed to follow each other at the rate of the sensor")
    for row in recording.gaps():
        assert recording.stamp_s is not None
        missing = recording.stamp_s[row] - recording.stamp_s[row - 1]
        notes.append(f"{missing:.2f} s between scans {recording.names[row - 1]} and {recording.names[row]}: a gap")
    labels = [name for name in _LABELS if recording.path.is_dir() and (recording.path / name).exists()]
    if labels:
        notes.append(f"{labels[0]} is there and not used: what is made here needs no labels")
    return notes

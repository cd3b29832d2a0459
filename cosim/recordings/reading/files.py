"""A file a scan: the formats of `cosim.point_files`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from cosim.point_files import SUFFIXES, Columns, PointOptions, PointReader, point_reader, suffix_of
from cosim.recordings.reading.source import Source
from cosim.recordings.scan import recording_errors

__all__ = ["SUFFIXES", "file_sources", "suffix_of"]


def file_sources(files: Sequence[Path], options: PointOptions | None = None) -> tuple[Source, ...]:
    """Scans of files, in the order given; a few are read to find the layout of raw numbers.

    Raises:
        RecordingError: raw files have no layout that fits.
        FormatError: a file cannot be read.
    """
    with recording_errors():
        reader = point_reader(files, options)
    return tuple(Source(_stem(file), partial(_read, reader, file)) for file in files)


def _read(reader: PointReader, file: Path) -> Columns:
    with recording_errors():
        return reader.read(file)


def _stem(file: Path) -> str:
    return file.name[: -len(suffix_of(file))] or file.stem

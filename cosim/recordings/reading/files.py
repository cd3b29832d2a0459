"""A file a scan: the formats of `cosim.point_files`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from cosim.errors import CosimError
from cosim.point_files import SUFFIXES, Columns, PointOptions, PointReader, point_reader, suffix_of
from cosim.point_files.scan import UnequalRowsError
from cosim.recordings.reading.source import Source
from cosim.recordings.scan import recording_errors

_SAMPLINGS = 7  # of the files, one of which may be without the damaged ones
__all__ = ["SUFFIXES", "file_sources", "suffix_of"]


def file_sources(files: Sequence[Path], options: PointOptions | None = None) -> tuple[Source, ...]:
    """Scans of files, in the order given; a few are read to find the layout of raw numbers.

    Raises:
        RecordingError: raw files have no layout that fits.
        FormatError: a file cannot be read.
    """
    with recording_errors():
        reader = _reader(files, options)
    return tuple(Source(_stem(file), partial(_read, reader, file)) for file in files)


def _reader(files: Sequence[Path], options: PointOptions | None) -> PointReader:
    """The reader of the files; damaged files do not affect the inferred layout of raw numbers.

    Raises:
        PointFileError: no sample of the files has a layout that fits.
    """
    try:
        return point_reader(files, options)
    except UnequalRowsError:
        raise
    except CosimError as error:
        for first in range(1, min(_SAMPLINGS, len(files) // 2)):
            try:
                return point_reader(files[first::_SAMPLINGS], options)
            except CosimError:
                continue
        raise error


def _read(reader: PointReader, file: Path) -> Columns:
    with recording_errors():
        return reader.read(file)


def _stem(file: Path) -> str:
    return file.name[: -len(suffix_of(file))] or file.stem

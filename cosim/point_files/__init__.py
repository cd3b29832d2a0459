"""One reader of point files for drives, recordings, detection, statistics and the view.

`formats` turns a file into columns, `raw` finds how rows of plain float32 are laid out, `schema` infers what the
columns mean and checks every guess against a second clue, `axes` checks the frame of reference, `scan` holds a result.
"""

from cosim.point_files.cloud import Columns
from cosim.point_files.formats import SUFFIXES, PointReader, point_reader, suffix_of
from cosim.point_files.options import PointOptions
from cosim.point_files.scan import PointFileError, Scan
from cosim.point_files.schema import PointSchema, find_schema, make_scan

__all__ = [
    "SUFFIXES",
    "Columns",
    "PointFileError",
    "PointOptions",
    "PointReader",
    "PointSchema",
    "Scan",
    "find_schema",
    "make_scan",
    "point_reader",
    "suffix_of",
]

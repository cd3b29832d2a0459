"""Readers, one for each family of formats: a path becomes sources of columns, which are read on demand."""

from cosim.recordings.reading.bags import bag_sources, is_bag
from cosim.recordings.reading.files import SUFFIXES, file_sources, suffix_of
from cosim.recordings.reading.ouster import OUSTER_SUFFIXES, ouster_sources
from cosim.recordings.reading.source import Source

__all__ = [
    "OUSTER_SUFFIXES",
    "SUFFIXES",
    "Source",
    "bag_sources",
    "file_sources",
    "is_bag",
    "ouster_sources",
    "suffix_of",
]

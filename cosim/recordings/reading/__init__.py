"""Readers, one for each family of formats: a path becomes sources of columns, which are read on demand."""

from cosim.recordings.reading.bags import bag_sources, is_bag
from cosim.recordings.reading.files import SUFFIXES, file_sources, suffix_of
from cosim.recordings.reading.packets import PACKET_SUFFIXES, packet_sources
from cosim.recordings.reading.source import Source

__all__ = [
    "PACKET_SUFFIXES",
    "SUFFIXES",
    "Source",
    "bag_sources",
    "file_sources",
    "is_bag",
    "packet_sources",
    "suffix_of",
]

"""Safe parsing of XML files."""

from __future__ import annotations

import gzip
import xml.etree.ElementTree as ET
import zlib
from pathlib import Path

from sumo_nets.errors import TownError

_LARGEST_BYTES = 1 << 30


def read_xml(path: Path, *roots: str) -> ET.Element:
    """Parse an XML file, plain or gzipped, that must be whole and free of document types and entities.

    Args:
        path: the file.
        roots: names its outermost element may have; any, if there are none.

    Raises:
        TownError: the file cannot be read, is not such XML, or its outermost element is another.
    """
    data = _read(path)
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise TownError(f"{path}: XML with a DOCTYPE or ENTITY is not accepted; remove it")
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise TownError(f"{path}: is not UTF-8; save it as UTF-8")
    try:
        element = ET.fromstring(data)
    except (ET.ParseError, ValueError, LookupError) as error:
        raise TownError(f"{path}: is not well-formed XML ({error})") from error
    if roots and element.tag not in roots:
        raise TownError(f"{path}: starts with <{element.tag}>, where a SUMO file of this kind starts with <{roots[0]}>")
    return element


def _read(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            zipped = file.read(2) == b"\x1f\x8b"
        with gzip.open(path, "rb") if zipped else path.open("rb") as file:
            data = file.read(_LARGEST_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise TownError(f"{path}: cannot be read ({error})") from error
    if len(data) > _LARGEST_BYTES:
        raise TownError(f"{path}: is larger than {_LARGEST_BYTES >> 30} GiB")
    return data

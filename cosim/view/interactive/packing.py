"""Binary record of one frame for a page: a JSON header followed by arrays and images, compressed with gzip.

Layout before gzip: uint32 little-endian length of the header, the header (UTF-8 JSON, padded with spaces to a
multiple of 4), then the arrays; offsets are relative to the end of the header. 16-bit integers are zigzag-encoded and
stored in two planes, low bytes first, so that smooth columns compress well; `delta` columns contain differences along
the scan, the first from 0, modulo 2¹⁶.
"""

from __future__ import annotations

import gzip
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

Coding = Literal["u8", "i16", "delta"]
UNSET = -32768


@dataclass(frozen=True, eq=False)
class PackedColumn:
    """A quantised value of every point.

    Attributes:
        name: name, for example `x` or `intensity`.
        values: (n,) integers: 0–255 for `u8`, else −32768–32767.
        scale: size of one step in the column's unit.
        coding: storage format.
    """

    name: str
    values: np.ndarray
    scale: float = 1.0
    coding: Coding = "u8"

    def encoded(self) -> bytes:
        """The stored bytes."""
        if self.coding == "u8":
            return np.ascontiguousarray(self.values, np.uint8).tobytes()
        values = np.asarray(self.values, np.int64)
        if self.coding == "delta":
            values = np.diff(values, prepend=0)
        folded = values.astype(np.uint16).view(np.int16).astype(np.int32)
        zigzag = ((folded << 1) ^ (folded >> 15)).astype(np.uint16)
        return (zigzag & 0xFF).astype(np.uint8).tobytes() + (zigzag >> 8).astype(np.uint8).tobytes()


def quantised(name: str, values: np.ndarray, scale: float, coding: Coding = "i16") -> PackedColumn:
    """A column of values (n,) in steps of `scale`, brought within ±32767 steps; NaN becomes `UNSET`."""
    steps = np.clip(np.rint(np.asarray(values, np.float64) / scale), -32767, 32767)
    return PackedColumn(name, np.where(np.isnan(steps), UNSET, np.nan_to_num(steps)).astype(np.int64), scale, coding)


def pack(
    header: Mapping[str, Any], columns: Sequence[PackedColumn], images: Mapping[str, bytes], *, thorough: bool = True
) -> bytes:
    """Encode a frame.

    Args:
        header: JSON values; the keys `columns` and `images` are added.
        columns: columns of equal length.
        images: encoded images by name.
        thorough: use strong instead of fast compression.
    """
    parts = [(column.name, column.encoded()) for column in columns] + list(images.items())
    starts = np.cumsum([0, *(len(data) for _, data in parts)]).tolist()
    table = [
        {"name": column.name, "coding": column.coding, "scale": column.scale, "offset": start}
        for column, start in zip(columns, starts, strict=False)
    ]
    pictures = [
        {"name": name, "offset": start, "length": len(data)}
        for (name, data), start in zip(images.items(), starts[len(columns) :], strict=False)
    ]
    count = len(columns[0].values) if columns else 0
    document = {**header, "points": count, "columns": table, "images": pictures}
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I", len(text)) + text + b"".join(data for _, data in parts)
    return gzip.compress(body, 6 if thorough else 1, mtime=0)

"""Reads packed frames as the layout is documented, independently of the code that packs them."""

from __future__ import annotations

import gzip
import json
import struct
from typing import Any

import numpy as np


def unpacked(data: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray], dict[str, bytes]]:
    """Header, columns in their units (NaN for unknown), and images."""
    body = gzip.decompress(data)
    (length,) = struct.unpack_from("<I", body)
    header, rest = json.loads(body[4 : 4 + length]), body[4 + length :]
    columns, count = {}, header["points"]
    for entry in header["columns"]:
        values = _values(rest[entry["offset"] :], entry["coding"], count)
        columns[entry["name"]] = np.where(_unknown(entry, values), np.nan, values * entry["scale"])
    images = {one["name"]: rest[one["offset"] :][: one["length"]] for one in header["images"]}
    return header, columns, images


def _values(data: bytes, coding: str, count: int) -> np.ndarray:
    if coding == "u8":
        return np.frombuffer(data, np.uint8, count).astype(float)
    low, high = np.frombuffer(data, np.uint8, 2 * count).reshape(2, count).astype(int)
    zigzag = low + 256 * high
    values = np.where(zigzag % 2, -(zigzag + 1) // 2, zigzag // 2)
    if coding == "delta":
        values = (np.cumsum(values) + 32768) % 65536 - 32768
    return values.astype(float)


def _unknown(entry: dict[str, Any], values: np.ndarray) -> np.ndarray:
    return (values == -32768) & (entry["scale"] != 1.0)

"""Serialisation of plain data: reading it runs no code.

A file holds the bytes of all arrays one after the other, each starting at a multiple of 8, a JSON tree with their types
and everything around them, the length of the tree [bytes], and a CRC-32 of all that. The arrays that are read are
views of the bytes: a file that is mapped into memory is not copied. Allowed are numbers, text, tuples, lists,
dictionaries, sets, numpy arrays, shapely geometries, Delaunay triangulations and dataclasses of this project.
"""

from __future__ import annotations

import hashlib
import json
import math
import struct
import zlib
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any, BinaryIO

import numpy as np
import shapely

_PACKAGES = ("assets", "sumo_nets", "sensors", "tests")
_DAMAGED = (LookupError, TypeError, AttributeError, ImportError, struct.error, shapely.errors.ShapelyError)
_LENGTH, _CHECKSUM = struct.Struct("<Q"), struct.Struct("<I")
_PLAIN = (type(None), bool, int, float, str)
_SEQUENCES: dict[str, Any] = {"tuple": tuple, "list": list, "set": set, "frozenset": frozenset}


def dump(value: Any, file: BinaryIO) -> None:
    """Write a value. A part that occurs twice is stored once.

    Raises:
        TypeError: a part is of a type that is not allowed.
        OSError: the file cannot be written.
    """
    writer = _Writer()
    root = writer.encode(value)
    tree = json.dumps({"nodes": writer.nodes, "root": root}).encode()
    checksum = 0
    for chunk in (*writer.chunks, tree, _LENGTH.pack(len(tree))):
        checksum = zlib.crc32(chunk, checksum)
        file.write(chunk)
    file.write(_CHECKSUM.pack(checksum))


def content_digest(value: Any) -> str:
    """SHA-1 of a value's content as hexadecimal digits: equal values, built in the same way, have the same digest.

    Raises:
        TypeError: a part is of a type that is not allowed.
    """
    writer = _Writer()
    tree = writer.encode(value)
    digest = hashlib.sha1(json.dumps([writer.nodes, tree]).encode(), usedforsecurity=False)
    for chunk in writer.chunks:
        digest.update(chunk)
    return digest.hexdigest()


def loads(data: bytes | memoryview) -> Any:
    """The value that `dump` wrote. Its arrays are views of the data, and writable where the data are.

    Raises:
        ValueError: the bytes are damaged, or name a class that is not a dataclass of this project.
    """
    stored = memoryview(data)
    try:
        (checksum,) = _CHECKSUM.unpack(stored[-_CHECKSUM.size :])
        checked = stored[: -_CHECKSUM.size]
        if zlib.crc32(checked) != checksum:
            raise ValueError("not what was written: the checksum differs")
        (length,) = _LENGTH.unpack(checked[-_LENGTH.size :])
        rest = checked[: -_LENGTH.size]
        start = len(rest) - length
        tree = json.loads(bytes(rest[start:]))
        return _Reader(tree["nodes"], np.frombuffer(rest[:start], np.uint8)).decode(tree["root"])
    except _DAMAGED as error:
        raise ValueError(f"not what was written: {error}") from error


class _Writer:
    """Encodes values; nodes are compound values by number, so that shared parts stay shared."""

    def __init__(self) -> None:
        self.nodes: list[dict[str, Any]] = []
        self.chunks: list[bytes | memoryview] = []
        self._length = 0
        self._numbers: dict[int, tuple[int, Any]] = {}  # by id; values are kept, so that ids stay theirs

    def encode(self, value: Any) -> Any:
        if isinstance(value, _PLAIN) and not isinstance(value, np.generic):
            return value
        if id(value) not in self._numbers:
            node = self._node(value)
            self._numbers[id(value)] = len(self.nodes), value
            self.nodes.append(node)
        return {"node": self._numbers[id(value)][0]}

    def _node(self, value: Any) -> dict[str, Any]:
        kind = type(value)
        if isinstance(value, np.ndarray | np.generic):
            if value.dtype.hasobject:
                raise TypeError("arrays of objects cannot be stored")
            start = self._stored(np.ascontiguousarray(value).reshape(-1).view(np.uint8).data)
            return {"array": start, "dtype": value.dtype.str, "shape": list(value.shape),
                    "scalar": isinstance(value, np.generic)}  # fmt: skip
        if isinstance(value, shapely.Geometry):
            data = shapely.to_wkb(value, include_srid=True)
            return {"wkb": self._stored(data), "size": len(data)}
        if kind.__name__ in _SEQUENCES and kind is _SEQUENCES[kind.__name__]:
            return {kind.__name__: [self.encode(part) for part in value]}
        if kind is dict:
            return {"dict": [[self.encode(key), self.encode(part)] for key, part in value.items()]}
        if is_dataclass(value) and kind.__module__.partition(".")[0] in _PACKAGES:
            parts = {field.name: self.encode(getattr(value, field.name)) for field in fields(value)}
            return {"class": f"{kind.__module__}:{kind.__qualname__}", "fields": parts}
        from scipy.spatial import Delaunay

        if kind is Delaunay:
            parts = {**vars(value), "_qhull": None}  # a handle of the library, closed after the triangulation
            return {"delaunay": {name: self.encode(part) for name, part in parts.items()}}
        raise TypeError(f"{kind.__module__}.{kind.__qualname__} cannot be stored")

    def _stored(self, data: bytes | memoryview) -> int:
        """Offset of the first byte; a multiple of 8."""
        start = self._length
        self.chunks += [data, bytes(-len(data) % 8)]
        self._length += len(data) + -len(data) % 8
        return start


class _Reader:
    """Decodes nodes in the order in which they were written: parts come before what holds them."""

    def __init__(self, nodes: list[dict[str, Any]], data: np.ndarray) -> None:
        self._data = data
        self._values: list[Any] = []
        for node in nodes:
            self._values.append(self._value(node))

    def decode(self, tree: Any) -> Any:
        return self._values[tree["node"]] if isinstance(tree, dict) else tree

    def _value(self, node: dict[str, Any]) -> Any:
        if "array" in node:
            kind, shape, start = np.dtype(node["dtype"]), tuple(node["shape"]), node["array"]
            size = kind.itemsize * math.prod(shape)
            array = self._data[start : start + size].view(kind).reshape(shape)
            return array[()] if node["scalar"] else array
        if "wkb" in node:
            return shapely.from_wkb(self._data[node["wkb"] : node["wkb"] + node["size"]].tobytes())
        if "delaunay" in node:
            from scipy.spatial import Delaunay

            return _filled(Delaunay, {name: self.decode(part) for name, part in node["delaunay"].items()})
        if "dict" in node:
            return {self.decode(key): self.decode(part) for key, part in node["dict"]}
        if "class" in node:
            return _instance(node["class"], {name: self.decode(part) for name, part in node["fields"].items()})
        (name, parts), *_ = node.items()
        return _SEQUENCES[name](self.decode(part) for part in parts)


def _instance(name: str, parts: dict[str, Any]) -> Any:
    """A dataclass of this project with given fields; its checks do not run again."""
    module, _, qualified = name.partition(":")
    if module.partition(".")[0] not in _PACKAGES:
        raise ValueError(f"{name} is not a class of this project")
    kind: Any = import_module(module)
    for part in qualified.split("."):
        kind = getattr(kind, part)
    if not (isinstance(kind, type) and is_dataclass(kind)):
        raise ValueError(f"{name} is not a dataclass")
    return _filled(kind, parts)


def _filled(kind: Any, parts: dict[str, Any]) -> Any:
    """An object with given attributes, made without its constructor."""
    value = object.__new__(kind)
    for name, part in parts.items():
        object.__setattr__(value, name, part)
    return value

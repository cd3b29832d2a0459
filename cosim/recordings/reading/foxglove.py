"""Clouds of MCAP files that are not ROS's: `foxglove.PointCloud` in Protocol Buffers or JSON.

The message and its numeric types are those of Foxglove's schemas (docs.foxglove.dev, "PointCloud"; MIT). Protocol
Buffers are decoded by the schema that the file itself holds.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cosim.point_files import Columns
from cosim.recordings.libraries import needed
from cosim.recordings.reading.source import Source
from cosim.recordings.scan import RecordingError

FOXGLOVE_CLOUD = "foxglove.PointCloud"
_KINDS = {1: "u1", 2: "i1", 3: "u2", 4: "i2", 5: "u4", 6: "i4", 7: "f4", 8: "f8"}  # PackedElementField.NumericType
_KIND_NAMES = {"UINT8": 1, "INT8": 2, "UINT16": 3, "INT16": 4, "UINT32": 5, "INT32": 6, "FLOAT32": 7, "FLOAT64": 8}
_MAGIC = b"\x89MCAP0\r\n"


def foxglove_sources(path: Path, topic: str | None = None) -> tuple[Source, ...] | None:
    """Scans of an MCAP file in the order of their log times; None where it holds no `foxglove.PointCloud`.

    Args:
        path: file.
        topic: which; may be left out where only one holds clouds.

    Raises:
        RecordingError: several topics, or the file cannot be read.
    """
    if path.suffix.lower() != ".mcap" or not path.is_file() or not _begins_as_mcap(path):
        return None
    with _readable(path):
        topics = _topics(path)
        if not topics:
            return None
        if topic is not None and topic not in topics:
            raise RecordingError(f"{path}: no {FOXGLOVE_CLOUD} on {topic}; choose from {', '.join(sorted(topics))}")
        if topic is None and len(topics) > 1:
            names = ", ".join(sorted(topics))
            raise RecordingError(f"{path}: clouds on {len(topics)} topics; choose with --topic: {names}")
        name = topic or next(iter(topics))
        decode = _decoder(*topics[name], path)
        with path.open("rb") as stream:
            stamps = [message.log_time for _, _, message in _messages(stream, name)]
    sources, same = [], Counter[int]()
    for number, stamp in enumerate(stamps):
        read = partial(_read, path, name, decode, stamp, same[stamp])
        sources.append(Source(f"{number:06d}", read, stamp / 1e9))
        same[stamp] += 1
    return tuple(sources)


def cloud_columns(cloud: Mapping[str, Any]) -> Columns:
    """The fields of a cloud, (n,) each.

    Args:
        cloud: `point_stride`, `fields` of name, offset and type, `data` in bytes.

    Raises:
        RecordingError: the stride is shorter than the fields, or the data are no whole number of points.
    """
    stride, data = int(cloud["point_stride"]), cloud["data"]
    fields = [field for field in cloud["fields"] if field["type"] in _KINDS]
    ends = [field["offset"] + np.dtype(_KINDS[field["type"]]).itemsize for field in fields]
    if stride <= 0 or max(ends, default=0) > stride or len(data) % stride:
        raise RecordingError(
            f"a cloud holds {len(data)} bytes in points of {stride} bytes, whose fields end at {max(ends, default=0)}; "
            "record it again"
        )
    row = np.dtype(
        {
            "names": [field["name"] for field in fields],
            "formats": ["<" + _KINDS[field["type"]] for field in fields],
            "offsets": [field["offset"] for field in fields],
            "itemsize": stride,
        }
    )
    points = np.frombuffer(data, row)
    return {name: points[name].astype(points[name].dtype.newbyteorder("=")) for name in row.names or ()}


def _begins_as_mcap(path: Path) -> bool:
    with path.open("rb") as stream:
        return stream.read(len(_MAGIC)) == _MAGIC


def _topics(path: Path) -> dict[str, tuple[str, bytes]]:
    """Encoding and schema of each topic of clouds."""
    with path.open("rb") as stream:
        summary = needed("mcap.reader", "an MCAP file").make_reader(stream).get_summary()
    if summary is None:
        return {}
    return {
        channel.topic: (channel.message_encoding, summary.schemas[channel.schema_id].data)
        for channel in summary.channels.values()
        if channel.schema_id in summary.schemas and summary.schemas[channel.schema_id].name == FOXGLOVE_CLOUD
    }


def _messages(stream: Any, topic: str, start: int | None = None) -> Iterator[Any]:
    reader = needed("mcap.reader", "an MCAP file").make_reader(stream)
    return reader.iter_messages(topics=[topic], starting_at=start, ending_before=None if start is None else start + 1)


def _read(path: Path, topic: str, decode: Callable[[bytes], Mapping[str, Any]], stamp: int, number: int) -> Columns:
    """The columns of the message of a stamp; `number` counts those that have it."""
    with _readable(path), path.open("rb") as stream:
        for position, (_, _, message) in enumerate(_messages(stream, topic, stamp)):
            if position == number:
                return cloud_columns(decode(message.data))
    raise RecordingError(f"{path}: ends before the message of {topic} at {stamp} ns")


def _decoder(encoding: str, schema: bytes, path: Path) -> Callable[[bytes], Mapping[str, Any]]:
    if encoding == "json":
        return _from_json
    if encoding == "protobuf":
        return partial(_from_protobuf, schema)
    raise RecordingError(f"{path}: {FOXGLOVE_CLOUD} encoded as {encoding!r}; protobuf and json are read")


def _from_json(data: bytes) -> Mapping[str, Any]:
    message = json.loads(data)
    fields = [
        {"name": each["name"], "offset": int(each["offset"]), "type": _KIND_NAMES.get(each["type"], each["type"])}
        for each in message["fields"]
    ]
    return {
        "point_stride": message["point_stride"],
        "fields": fields,
        "data": base64.b64decode(message["data"], validate=True),
    }


def _from_protobuf(schema: bytes, data: bytes) -> Mapping[str, Any]:
    message = _message_class(schema).FromString(data)
    fields = [{"name": each.name, "offset": each.offset, "type": each.type} for each in message.fields]
    return {"point_stride": message.point_stride, "fields": fields, "data": message.data}


def _message_class(schema: bytes) -> Any:
    descriptors = needed("google.protobuf.descriptor_pb2", "Protocol Buffers").FileDescriptorSet.FromString(schema)
    pool = needed("google.protobuf.descriptor_pool", "Protocol Buffers").DescriptorPool()
    waiting = list(descriptors.file)
    while waiting:  # files that others import come first
        ready = [each for each in waiting if not {other.name for other in waiting} & set(each.dependency)]
        for each in ready or waiting[:1]:
            pool.Add(each)
            waiting.remove(each)
    factory = needed("google.protobuf.message_factory", "Protocol Buffers")
    return factory.GetMessageClass(pool.FindMessageTypeByName(FOXGLOVE_CLOUD))


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Convert any exception of the parsers to an error with the file's name."""
    try:
        yield
    except RecordingError:
        raise
    except (KeyError, TypeError, ValueError, binascii.Error) as error:
        raise RecordingError(f"{path}: a cloud is not as Foxglove's schema has it: {_short(error)}") from None
    except Exception as error:  # noqa: BLE001 - mcap and protobuf raise whatever they meet in a damaged file
        raise RecordingError(
            f"{path}: not a readable MCAP file: its parser says {_short(error)}; compare its size with the original"
        ) from None


def _short(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:160]

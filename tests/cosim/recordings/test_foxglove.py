"""Clouds of `foxglove.PointCloud` in MCAP files, in both encodings that Foxglove's tools write."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim.recordings import RecordingError, open_recording
from tests.cosim.recordings.test_readers import points, same

pytest.importorskip("mcap.writer")
descriptor_pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")

_TYPES = {"f4": 7, "u1": 1, "u2": 3, "u4": 5}
_NAMES = {7: "FLOAT32", 1: "UINT8", 3: "UINT16", 5: "UINT32"}


def fields_of(rows: np.ndarray) -> list[dict[str, Any]]:
    places = rows.dtype.fields or {}
    return [{"name": name, "offset": at[1], "type": _TYPES[at[0].str[1:]]} for name, at in places.items()]


def schema() -> bytes:
    """The part of Foxglove's schema that holds the points, as a file descriptor set of two files."""
    field = descriptor_pb2.FieldDescriptorProto
    files = descriptor_pb2.FileDescriptorSet()
    cloud = files.file.add(name="cloud.proto", package="foxglove", syntax="proto3", dependency=["field.proto"])
    message = cloud.message_type.add(name="PointCloud")
    message.field.add(name="frame_id", number=2, type=field.TYPE_STRING, label=1)
    message.field.add(name="point_stride", number=4, type=field.TYPE_FIXED32, label=1)
    message.field.add(
        name="fields", number=5, type=field.TYPE_MESSAGE, label=3, type_name=".foxglove.PackedElementField"
    )
    message.field.add(name="data", number=6, type=field.TYPE_BYTES, label=1)
    packed = files.file.add(name="field.proto", package="foxglove", syntax="proto3").message_type.add(
        name="PackedElementField"
    )
    packed.field.add(name="name", number=1, type=field.TYPE_STRING, label=1)
    packed.field.add(name="offset", number=2, type=field.TYPE_FIXED32, label=1)
    packed.field.add(name="type", number=3, type=field.TYPE_INT32, label=1)
    return files.SerializeToString()


def encode(rows: np.ndarray, encoding: str, stride: int | None = None) -> bytes:
    """A message; `stride` states another size of a point than the true one."""
    stride, fields = stride or rows.dtype.itemsize, fields_of(rows)
    if encoding == "json":
        named = [{**each, "type": _NAMES[each["type"]]} for each in fields]
        data = base64.b64encode(rows.tobytes()).decode()
        return json.dumps({"frame_id": "l", "point_stride": stride, "fields": named, "data": data}).encode()
    from google.protobuf import descriptor_pool, message_factory

    pool = descriptor_pool.DescriptorPool()
    for each in reversed(descriptor_pb2.FileDescriptorSet.FromString(schema()).file):
        pool.Add(each)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.PointCloud"))
    message = kind(frame_id="l", point_stride=stride, fields=fields, data=rows.tobytes())
    return message.SerializeToString()


def write_mcap(path: Path, encoding: str, topics: dict[str, list[bytes]], name: str = "foxglove.PointCloud") -> Path:
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        known = {"protobuf": "protobuf", "json": "jsonschema"}
        held = writer.register_schema(name, known[encoding], schema() if encoding == "protobuf" else b"{}")
        for topic, messages in topics.items():
            channel = writer.register_channel(topic, encoding, held)
            for number, message in enumerate(messages):
                stamp = 10**18 + number // 2 * 10**8  # two messages share a stamp of the log
                writer.add_message(channel, stamp if len(messages) > 3 else 10**18 + number * 10**8, message, 0)
        writer.finish()
    return path


@pytest.mark.parametrize("encoding", ["protobuf", "json"])
def test_clouds_are_read_in_any_order(encoding, tmp_path):
    clouds = [points(seed) for seed in range(3)]
    path = write_mcap(tmp_path / "a.mcap", encoding, {"/points": [encode(rows, encoding) for rows in clouds]})
    recording = open_recording(path)
    assert len(recording) == 3 and recording.interval_s == pytest.approx(0.1)
    for number in (2, 0, 1):
        same(recording[number], clouds[number])
    same(open_recording(tmp_path)[1], clouds[1])  # the folder of the file


@pytest.mark.parametrize(
    ("topics", "says"),
    [
        ({"/a": [b"x"], "/b": [b"x"]}, "choose with --topic: /a, /b"),
        ({"/a": [b"\xff\xff"]}, "its parser says|not as Foxglove's schema"),
        ({"/a": [encode(points(), "protobuf", stride=7)]}, "points of 7 bytes"),
    ],
)
def test_clouds_that_are_none_are_refused_with_the_reason(topics, says, tmp_path):
    path = write_mcap(tmp_path / "a.mcap", "protobuf", topics)
    with pytest.raises(RecordingError, match=says) as caught:
        open_recording(path)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_cut_off_is_refused(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", "json", {"/a": [encode(points(), "json")]})
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(RecordingError, match=r"a\.mcap"):
        open_recording(path)

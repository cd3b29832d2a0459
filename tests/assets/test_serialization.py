"""Stored values are the values that were stored; other files are refused without running anything."""

from __future__ import annotations

import io
import json
import pickle
import zlib
from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from scipy.spatial import Delaunay

from assets.serialization import dump, loads


@dataclass(frozen=True)
class Thing:
    name: str
    parts: tuple
    values: np.ndarray


class NoDataclass:
    pass


def dumps(value) -> bytes:
    file = io.BytesIO()
    dump(value, file)
    return file.getvalue()


def test_nested_values_are_read_as_they_were() -> None:
    area = shapely.Polygon([(0, 0), (1, 0), (1, 2.5)])
    values = np.arange(6, dtype=np.float32).reshape(2, 3)
    thing = Thing("ö", ({"a": [1, 2.5, None, True], 3: {"x"}}, area, frozenset((1, 2)), np.float64(0.1)), values)
    read = loads(dumps((thing, thing, values)))
    assert isinstance(read[0], Thing) and read[0] is read[1] and read[0].values is read[2]
    assert read[0].name == "ö" and read[0].parts[0] == {"a": [1, 2.5, None, True], 3: {"x"}}
    assert read[0].parts[1].equals_exact(area) and read[0].parts[2:] == (frozenset((1, 2)), 0.1)
    assert read[2].dtype == np.float32 and np.array_equal(read[2], values)


def test_triangulations_find_the_same_triangles() -> None:
    points = np.random.default_rng(0).random((50, 2))
    triangles, places = Delaunay(points), np.random.default_rng(1).random((30, 2))
    read = loads(dumps(triangles))
    assert np.array_equal(read.find_simplex(places), triangles.find_simplex(places))


@pytest.mark.parametrize("value", [NoDataclass(), np.array([{}], object), print])
def test_other_types_are_refused(value) -> None:
    with pytest.raises(TypeError):
        dumps(value)


def test_files_of_other_types_are_refused() -> None:
    whole = dumps({"a": np.zeros(3)})
    changed = bytes([whole[0] ^ 1]) + whole[1:]
    for data in (b"", whole[:-40], whole[8:], changed, bytes(len(whole)), pickle.dumps(print)):
        with pytest.raises(ValueError):
            loads(data)


@pytest.mark.parametrize("name", ["subprocess:Popen", "assets.serialization:loads", "assets.nothing:Thing"])
def test_only_dataclasses_of_the_project_are_made(name: str) -> None:
    tree = json.dumps({"nodes": [{"class": name, "fields": {}}], "root": {"node": 0}}).encode()
    data = tree + len(tree).to_bytes(8, "little")
    with pytest.raises(ValueError, match=name.partition(":")[0]):
        loads(data + zlib.crc32(data).to_bytes(4, "little"))


def test_arrays_are_views_of_what_is_read() -> None:
    data = bytearray(dumps(("odd", np.arange(3, dtype=np.uint8), np.arange(5.0))))
    stored = np.frombuffer(data, np.uint8)
    _, small, large = loads(memoryview(data))
    assert np.shares_memory(small, stored) and np.shares_memory(large, stored)
    assert large.flags.aligned and large.flags.writeable and np.array_equal(large, np.arange(5.0))

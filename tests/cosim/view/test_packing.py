"""Frames reach the page as they were: every number within half a step, what is unknown as unknown."""

from __future__ import annotations

import gzip
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cosim.drives.kitti import Drive
from cosim.view.interactive import show_drives
from cosim.view.interactive.packing import UNSET, PackedColumn, pack, quantised
from tests.cosim.discrepancy.small_drive import make_yard
from tests.cosim.view.unpacking import unpacked


@given(
    arrays(np.int16, st.integers(0, 50), elements=st.integers(-32768, 32767)),
    st.sampled_from(["i16", "delta"]),
)
def test_columns_come_back_to_the_bit(values: np.ndarray, coding: Any) -> None:
    packed = pack({}, [PackedColumn("x", values, 1.0, coding)], {})
    _, columns, _ = unpacked(packed)
    np.testing.assert_array_equal(columns["x"], values.astype(float))


def test_lengths_come_back_within_half_a_step_and_the_unknown_as_unknown() -> None:
    metres = np.array([0.0, 1.23456, -80.0049, np.nan, 5000.0])
    column = quantised("x", metres, 0.005)
    assert column.values[3] == UNSET
    assert abs(column.values[:3] * 0.005 - metres[:3]).max() <= 0.0025
    assert column.values[4] == 32767


def test_images_and_header_come_back(labelled_drive: Path) -> None:
    header, _, images = unpacked(pack({"name": "ü"}, [PackedColumn("a", np.arange(7))], {"one": b"12345", "two": b""}))
    assert header["name"] == "ü" and header["points"] == 7
    assert images == {"one": b"12345", "two": b""}


def test_equal_frames_give_equal_bytes(labelled_drive: Path) -> None:
    records = show_drives([Drive(labelled_drive)], None, None, None, for_file=True).records[0]
    assert records.whole("000001") == records.whole("000001")


def test_a_frame_holds_its_points_boxes_and_camera(labelled_drive: Path, scan: np.ndarray) -> None:
    drive = Drive(labelled_drive)
    packed = show_drives([drive], None, None, None, for_file=True).records[0].whole("000001")
    header, columns, images = unpacked(packed)
    xyz = np.column_stack([columns[name] for name in "xyz"])
    assert abs(xyz - scan[:, :3]).max() <= 0.0026
    assert abs(columns["intensity"] - scan[:, 3]).max() <= 0.5 / 255 + 1e-6
    assert [box["kind"] for box in header["boxes"]] == ["Car"]
    np.testing.assert_allclose(header["boxes"][0]["centre"], [12, 2, -0.9], atol=0.02)
    assert (columns["instance"] == 0).sum() == 96
    camera = header["cameras"][0]
    uv, depth = drive["000001"].calibration.project(scan, 2)
    carried = np.column_stack([scan[:, :3], np.ones(len(scan))]) @ np.reshape(camera["matrix"], (3, 4)).T
    ahead = depth > 1
    np.testing.assert_allclose(carried[ahead, :2] / carried[ahead, 2:], uv[ahead], atol=1e-3)
    assert images["image_2"].startswith(b"\xff\xd8")
    assert {"material", "residual"} <= set(header["absent"])


def test_residuals_are_measured_minus_traced_range(tmp_path: Path) -> None:
    from sensors.effects.registry import find_effect

    yard = make_yard(tmp_path, (find_effect("range_bias").model_validate({"offset_m": 0.04}),), frames=1)
    drive = Drive(yard.drive)
    bare = show_drives([drive], None, None, str(yard.sensor), for_file=True).records[0]
    _, columns, _ = unpacked(bare.whole("000000"))
    assert abs(np.nanmedian(columns["residual"]) - 0.04) < 0.0011
    header, quick, _ = unpacked(bare.quick("000000"))
    assert "residual" not in quick and set(header["deferred"]) == {"residual", "material"}
    _, extra, _ = unpacked(bare.extra("000000"))
    np.testing.assert_array_equal(extra["residual"], columns["residual"])


def test_a_broken_twin_removes_only_the_residual(tmp_path: Path) -> None:
    yard = make_yard(tmp_path, frames=1)
    (yard.drive / "twin/static.glb").write_bytes(b"broken")
    records = show_drives([Drive(yard.drive)], None, None, None, for_file=True).records[0]
    header, columns, _ = unpacked(records.whole("000000"))
    assert "static.glb" in header["absent"]["residual"]
    assert "intensity" in columns and "ring" in columns


def test_headers_are_padded_to_whole_words() -> None:
    body = gzip.decompress(pack({"name": "x"}, [], {}))
    (length,) = struct.unpack_from("<I", body)
    assert length % 4 == 0
    assert json.loads(body[4 : 4 + length])["points"] == 0

"""PNG images: without loss, and on KITTI's depth scale."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.drives.kitti.images import decode_depth, decode_image, encode_depth, encode_gray, encode_rgb
from cosim.errors import FormatError


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 2**32 - 1))
def test_images_survive_the_file(height: int, width: int, seed: int) -> None:
    image = np.random.default_rng(seed).integers(0, 256, (height, width, 3), np.uint8)
    assert np.array_equal(decode_image(encode_rgb(image)), image)
    assert np.array_equal(decode_image(encode_gray(image[..., 0])), image[..., 0])
    assert encode_rgb(image) == encode_rgb(image.copy())


@given(st.floats(0.0625, 255.875, width=32))
def test_depth_is_exact_to_half_a_step(depth_m: float) -> None:
    read = decode_depth(encode_depth(np.full((2, 3), depth_m, np.float32)))
    assert np.abs(read - depth_m).max() <= 0.5 / 256 + 1e-6


def test_nothing_stays_nothing() -> None:
    depth = np.array([[np.nan, np.inf, -np.inf, -1, 0, 300, 1]], np.float32)
    assert decode_depth(encode_depth(depth)).tolist() == [[0, 0, 0, 0, 0, 0, 1]]


def test_one_metre_is_256_to_any_reader() -> None:
    raw = cv2.imdecode(np.frombuffer(encode_depth(np.ones((1, 1))), np.uint8), cv2.IMREAD_UNCHANGED)
    assert raw.dtype == np.uint16
    assert raw[0, 0] == 256


def test_red_is_red_to_any_reader() -> None:
    red = np.zeros((2, 2, 3), np.uint8)
    red[..., 0] = 255
    bgr = cv2.imdecode(np.frombuffer(encode_rgb(red), np.uint8), cv2.IMREAD_COLOR)
    assert bgr[0, 0].tolist() == [0, 0, 255]


def test_faults_are_named() -> None:
    gray = encode_gray(np.zeros((2, 2), np.uint8))
    with pytest.raises(FormatError, match=r"a\.png: not a readable image \(5 bytes\)"):
        decode_image(b"hello", "a.png")
    with pytest.raises(FormatError, match="not a readable image"):
        decode_image(b"", "a.png")
    with pytest.raises(FormatError, match="depth is one 16-bit channel"):
        decode_depth(gray, "a.png")
    with pytest.raises(FormatError, match="8-bit ones are expected"):
        decode_image(encode_depth(np.ones((1, 1))), "a.png")
    with pytest.raises(FormatError, match=r"not float64 of shape \(2, 2\)"):
        encode_gray(np.zeros((2, 2)))
    with pytest.raises(FormatError, match="3 channels, not 4"):
        encode_rgb(np.zeros((2, 2, 4), np.uint8))
    with pytest.raises(FormatError, match="float metres"):
        encode_depth(np.zeros((2, 2), np.uint16))

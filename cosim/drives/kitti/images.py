"""PNG images: 8-bit gray, 8-bit RGB, 16-bit depth on the KITTI scale (256 = 1 m, 0 = nothing), 16-bit instances."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from cosim.drives.files import read_bytes
from cosim.errors import FormatError

DEPTH_SCALE_PER_M = 256.0
_DEPTH_LIMIT = 65535


def encode_gray(image: np.ndarray) -> bytes:
    """PNG bytes of a grayscale image.

    Args:
        image: (h, w) uint8.

    Raises:
        FormatError: another shape or dtype.
    """
    _check(image, 2, np.uint8, "a grayscale image", "(h, w)")
    return _encode(image)


def encode_rgb(image: np.ndarray) -> bytes:
    """PNG bytes of a colour image, (h, w, 3) uint8 in the order red, green, blue.

    Raises:
        FormatError: another shape or dtype.
    """
    _check(image, 3, np.uint8, "a colour image", "(h, w, 3)")
    if image.shape[2] != 3:
        raise FormatError(f"a colour image has 3 channels, not {image.shape[2]}: red, green, blue")
    return _encode(cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2BGR))


def encode_depth(depth_m: np.ndarray) -> bytes:
    """PNG bytes of a depth image.

    Args:
        depth_m: (h, w) float depth along the optical axis [m]. What is not finite, not positive or beyond
            the scale's end (255.99 m) is stored as 0, nothing.

    Raises:
        FormatError: another shape, or integers.
    """
    if depth_m.ndim != 2 or depth_m.dtype.kind != "f":
        raise FormatError(
            f"a depth image is float metres of shape (h, w), not {depth_m.dtype} of shape {depth_m.shape}"
        )
    return _encode(depth_to_png16(depth_m))


def encode_instances(numbers: np.ndarray) -> bytes:
    """PNG bytes of an instance image, (h, w) uint16: row of the frame's instances + 1, 0 for all else.

    Raises:
        FormatError: another shape or dtype.
    """
    _check(numbers, 2, np.uint16, "an instance image", "(h, w)")
    return _encode(numbers)


def depth_to_png16(depth_m: np.ndarray) -> np.ndarray:
    """Depth in metres as the uint16 values of KITTI's scale; see `encode_depth`."""
    scaled = np.rint(depth_m * DEPTH_SCALE_PER_M)
    within = (scaled > 0) & (scaled <= _DEPTH_LIMIT)  # false for NaN
    return np.where(within, scaled, 0).astype(np.uint16)


def decode_image(data: bytes, source: str | Path = "image") -> np.ndarray:
    """The pixels of an 8-bit image: (h, w) uint8 if it is gray, (h, w, 3) uint8 RGB if it has colour.

    Raises:
        FormatError: not an 8-bit image.
    """
    image = _decode(data, source)
    if image.dtype != np.uint8:
        raise FormatError(f"{source}: {image.dtype} pixels where 8-bit ones are expected (depth goes to depth_0)")
    if image.ndim == 2:
        return image
    code = cv2.COLOR_BGRA2RGB if image.shape[2] == 4 else cv2.COLOR_BGR2RGB
    return cv2.cvtColor(image, code)


def decode_depth(data: bytes, source: str | Path = "depth") -> np.ndarray:
    """Depth in metres, (h, w) float32; 0 where there is nothing.

    Raises:
        FormatError: not a 16-bit single-channel image.
    """
    image = _decode(data, source)
    if image.dtype != np.uint16 or image.ndim != 2:
        raise FormatError(
            f"{source}: {image.dtype} of shape {image.shape}; depth is one 16-bit channel, 256 = 1 m, 0 = nothing"
        )
    return image.astype(np.float32) / np.float32(DEPTH_SCALE_PER_M)


def decode_instances(data: bytes, source: str | Path = "instances") -> np.ndarray:
    """Instance numbers, (h, w) uint16; see `encode_instances`.

    Raises:
        FormatError: not a 16-bit single-channel image.
    """
    image = _decode(data, source)
    if image.dtype != np.uint16 or image.ndim != 2:
        raise FormatError(f"{source}: {image.dtype} of shape {image.shape}; instances are one 16-bit channel")
    return image


def read_image(path: str | Path) -> np.ndarray:
    """Read an 8-bit image; see `decode_image`."""
    return decode_image(read_bytes(path), path)


def read_depth(path: str | Path) -> np.ndarray:
    """Read a depth image; see `decode_depth`."""
    return decode_depth(read_bytes(path), path)


def read_instances(path: str | Path) -> np.ndarray:
    """Read an instance image; see `decode_instances`."""
    return decode_instances(read_bytes(path), path)


def _encode(image: np.ndarray) -> bytes:
    # No flags: OpenCV's default (level 1, run lengths, one fixed filter) halves the time of any setting,
    # since naming one turns adaptive filtering on.
    done, data = cv2.imencode(".png", np.ascontiguousarray(image))
    if not done:
        raise FormatError(f"an image of shape {image.shape} cannot be stored as PNG")
    return data.tobytes()


def _decode(data: bytes, source: str | Path) -> np.ndarray:
    buffer = np.frombuffer(data, np.uint8)
    image = cv2.imdecode(buffer, cv2.IMREAD_UNCHANGED) if len(buffer) else None
    if image is None:
        raise FormatError(f"{source}: not a readable image ({len(data)} bytes); write it again")
    return image


def _check(image: np.ndarray, ndim: int, dtype: type, what: str, shape: str) -> None:
    if image.ndim != ndim or image.dtype != dtype or not image.size:
        raise FormatError(
            f"{what} is {np.dtype(dtype).name} of shape {shape}, not {image.dtype} of shape {image.shape}"
        )

"""Beam of each point: `rays/NAME.npz`, in the order of the `.bin` file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.drives.files import read_bytes
from cosim.errors import FormatError
from sensors.npz import NpzError, npz_arrays, npz_bytes

_DTYPES = {"ring": "|u1", "azimuth": "<f4", "time_s": "<f4", "return_no": "|u1"}


@dataclass(frozen=True, eq=False)
class PointRays:
    """The beam of every point of a scan.

    Attributes:
        ring: (n,) uint8, 0 is the top laser.
        azimuth: (n,) float32 nominal beam azimuth [rad], counter-clockwise from +x.
        time_s: (n,) float32 firing time [s] from the pose time.
        return_no: (n,) uint8, counted from 0.
        recovered: true when made up from the order of the points, because the drive has no `rays/`.
    """

    ring: np.ndarray
    azimuth: np.ndarray
    time_s: np.ndarray
    return_no: np.ndarray
    recovered: bool = False

    def __post_init__(self) -> None:
        for name, dtype in _DTYPES.items():
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype))
            array = getattr(self, name)
            if array.shape != self.ring.shape or array.ndim != 1:
                raise FormatError(f"rays: {name} has shape {array.shape}, ring {self.ring.shape}; give (n,) each")
        for name in ("azimuth", "time_s"):
            if not np.isfinite(getattr(self, name)).all():
                raise FormatError(f"rays: {name} holds NaN or infinity; every point has a beam")

    def __len__(self) -> int:
        return len(self.ring)

    def __getitem__(self, rows: np.ndarray | slice) -> PointRays:
        """The rays of some of the points, by mask, index array or slice."""
        columns = (getattr(self, name)[rows] for name in _DTYPES)
        return PointRays(*columns, recovered=self.recovered)


def encode_rays(rays: PointRays) -> bytes:
    """The bytes of an `.npz` file that `numpy.load` reads; equal rays give equal bytes."""
    return npz_bytes({name: getattr(rays, name) for name in _DTYPES})


def decode_rays(data: bytes, source: str | Path = "rays", points: int | None = None) -> PointRays:
    """The rays of an `.npz` file.

    Args:
        data: the content of the file.
        source: the name that errors mention.
        points: number of points of the scan, to be compared with, if known.

    Raises:
        FormatError: not an `.npz` file, an array missing, of another kind or length.
    """
    try:
        arrays = npz_arrays(data)
    except NpzError as error:
        raise FormatError(f"{source}: {error}; write it again") from None
    missing = [name for name in _DTYPES if name not in arrays]
    if missing:
        raise FormatError(f"{source}: missing {', '.join(missing)}; rays have {', '.join(_DTYPES)}")
    for name, dtype in _DTYPES.items():
        _check_column(arrays[name], np.dtype(dtype), f"{source}: {name}", points)
    try:
        return PointRays(arrays["ring"], arrays["azimuth"], arrays["time_s"], arrays["return_no"])
    except FormatError as error:
        raise FormatError(f"{source}: {error}") from None


def write_rays(path: str | Path, rays: PointRays) -> None:
    """Write an `.npz` file; see `encode_rays`."""
    Path(path).write_bytes(encode_rays(rays))


def read_rays(path: str | Path, points: int | None = None) -> PointRays:
    """Read an `.npz` file; see `decode_rays`."""
    return decode_rays(read_bytes(path), path, points)


def _check_column(array: np.ndarray, dtype: np.dtype, what: str, points: int | None) -> None:
    if array.ndim != 1 or not np.can_cast(array.dtype, dtype, "same_kind"):
        raise FormatError(f"{what} is {array.dtype} of shape {array.shape}; expected {dtype.name} of shape (n,)")
    if dtype.kind == "u" and len(array) and not 0 <= int(array.min()) <= int(array.max()) <= 255:
        raise FormatError(f"{what} spans {array.min()}…{array.max()}; it must lie in 0…255")
    if points is not None and len(array) != points:
        raise FormatError(f"{what} has {len(array)} entries but the scan {points} points; give one a point")

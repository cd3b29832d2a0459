"""NumPy archives: written so that their bytes depend on nothing but their contents, read without trust in them."""

from __future__ import annotations

import io
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping

import numpy as np

_DATE = (1980, 1, 1, 0, 0, 0)  # the zip format's zero
_UNIX = 3
_LEVEL = 1
_PROBE_BYTES = 32768
_LARGEST_BYTES = 1 << 30  # of an archive once unpacked; a few bytes of zip can claim any size


class NpzError(ValueError):
    """Bytes are no archive of plain arrays."""


def npz_bytes(arrays: Mapping[str, np.ndarray]) -> bytes:
    """An `.npz` archive that `numpy.load` reads, without the time or the system of writing.

    Args:
        arrays: name → array, written in this order; deflated where that shrinks them.
    """
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w") as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.ascontiguousarray(array), version=(1, 0), allow_pickle=False)
            data = member.getvalue()
            entry = zipfile.ZipInfo(f"{name}.npy", _DATE)
            entry.create_system = _UNIX
            entry.compress_type = zipfile.ZIP_DEFLATED if _is_compressible(data) else zipfile.ZIP_STORED
            archive.writestr(entry, data, compresslevel=_LEVEL)
    return target.getvalue()


def npz_arrays(data: bytes) -> dict[str, np.ndarray]:
    """The arrays of an `.npz` archive, by name.

    Raises:
        NpzError: not such an archive, damaged, of Python objects, or unreasonably large once unpacked.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = archive.infolist()
            if sum(member.file_size for member in members) > _LARGEST_BYTES:
                raise NpzError(f"unpacks to more than {_LARGEST_BYTES >> 20} MiB")
            return {member.filename.removesuffix(".npy"): _array(archive.read(member)) for member in members}
    except _DAMAGES as error:
        raise NpzError(f"not a readable .npz file: {' '.join(str(error).split())}") from None


# What zipfile, zlib and numpy raise on bytes that are not what they claim to be.
_DAMAGES = (
    ValueError, OSError, EOFError, KeyError, IndexError, TypeError, OverflowError, SyntaxError, MemoryError,
    AttributeError, NotImplementedError, RuntimeError, struct.error, tokenize.TokenError, zipfile.BadZipFile,
    zlib.error,
)  # fmt: skip


def _array(data: bytes) -> np.ndarray:
    """An array from the content of an `.npy` file, whose header must agree with its length."""
    file = io.BytesIO(data)
    if np.lib.format.read_magic(file) != (1, 0):
        raise NpzError("an array is of another version of the format")
    shape, in_fortran_order, dtype = np.lib.format.read_array_header_1_0(file)
    if dtype.hasobject:
        raise NpzError("an array holds Python objects")
    body = data[file.tell() :]
    if math.prod(shape) * dtype.itemsize != len(body) or dtype.itemsize == 0:
        raise NpzError(f"an array of shape {shape} is not as long as it says")
    flat = np.frombuffer(body, dtype)
    return flat.reshape(shape, order="F" if in_fortran_order else "C").copy()


def _is_compressible(data: bytes) -> bool:
    """Whether a sample from the middle shrinks: azimuths of fanned lasers do not, and cost most."""
    start = max(0, (len(data) - _PROBE_BYTES) // 2)
    sample = data[start : start + _PROBE_BYTES]
    return len(zlib.compress(sample, _LEVEL)) < 0.8 * len(sample)

"""The heap of the C library."""

from __future__ import annotations

import ctypes
import sys


def return_free_blocks() -> None:
    """Return free blocks between used ones to the system; does nothing without glibc, which keeps them otherwise."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)

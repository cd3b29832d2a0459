"""The heap of processes that build one world after another."""

from __future__ import annotations

import ctypes
import sys

# glibc by default raises the size from which a block is returned to the system when it is freed to that of the largest
# block freed so far, up to 32 MiB; such a process then keeps 100 MB more. And it has a heap for each thread, of which
# that of the thread that encodes and writes files keeps another 20 MB.
SMALL_HEAP = {
    "MALLOC_MMAP_THRESHOLD_": str(4 << 20),
    "MALLOC_TRIM_THRESHOLD_": str(64 << 20),
    "MALLOC_ARENA_MAX": "1",
}
"""Environment variables with which glibc keeps one heap and returns large blocks to the system when they are freed."""


def return_free_blocks() -> None:
    """Return free memory to the system that glibc keeps because it lies between used blocks.

    Does nothing with other C libraries.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)

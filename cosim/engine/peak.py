"""The most memory that this process has held."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

_STATUS = Path("/proc/self/status")


def peak_bytes() -> int:
    """In bytes. What getrusage says includes what the parent held when it forked, so Linux's own figure comes first."""
    if _STATUS.is_file():
        found = (line.split() for line in _STATUS.read_text().splitlines() if line.startswith("VmHWM:"))
        return next((int(words[1]) * 1024 for words in found), 0)
    kept = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return kept if sys.platform == "darwin" else kept * 1024

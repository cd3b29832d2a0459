"""Peak memory of this process."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

_STATUS = Path("/proc/self/status")


def peak_bytes() -> int:
    """Peak resident memory of this process [bytes].

    Read from /proc where it exists, because getrusage includes the parent's memory at the time of the fork.
    """
    if _STATUS.is_file():
        rows = (line.split() for line in _STATUS.read_text().splitlines() if line.startswith("VmHWM:"))
        return next((int(words[1]) * 1024 for words in rows), 0)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024

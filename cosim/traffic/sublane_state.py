"""Saved states of SUMO, changed so that the sublane model continues from them in the same way in every process.

In a saved state, `lcStateBase` of a vehicle is the state of its lane change model, followed by pairs of an acceleration
and a flag: the speed advice that the model has stored for the next step. SUMO 1.28 restores this advice, but the
constructor of the sublane model (`MSLCM_SL2015`) does not initialise `myDontBrake`. Until vehicles change lanes in the
first step, this member has the value that was in its memory before, and it decides whether a vehicle with speed advice
follows it. The speed of this vehicle, and later that of others, would therefore depend on the layout of the memory,
which differs between processes. SUMO does not use the member of vehicles without speed advice.
"""

from __future__ import annotations

import re
from pathlib import Path

_SPEED_ADVICE = re.compile(r'(\blcStateBase="[^" ]*) [^"]*(?=")')


def drop_speed_advice(path: Path) -> Path:
    """Remove the speed advice from a saved state; the lane change model computes it again in the first step.

    Args:
        path: saved state, not compressed.

    Returns:
        Path of the changed copy, in the same folder; `path` itself if no vehicle has a speed advice.
    """
    text, count = _SPEED_ADVICE.subn(r"\1", path.read_text(encoding="utf-8"))
    if not count:
        return path
    changed = path.with_name(f"{path.stem}-sublane{path.suffix}")
    changed.write_text(text, encoding="utf-8")
    return changed

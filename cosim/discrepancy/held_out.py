"""Which frames are fitted and which only judge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

_SEGMENT = 3


@dataclass(frozen=True)
class Split:
    """Names of frames that are fitted, and of those that took no part; the same where there are too few for both."""

    fit: tuple[str, ...]
    test: tuple[str, ...]

    @property
    def is_held_out(self) -> bool:
        """Whether the test frames took no part in the fit."""
        return not set(self.fit) & set(self.test)


def split_frames(names: Sequence[str]) -> Split:
    """Every fourth segment of consecutive frames judges, the rest is fitted."""
    size = max(1, min(_SEGMENT, len(names) // 8))
    test = tuple(name for place, name in enumerate(names) if place // size % 4 == 3)
    fit = tuple(name for name in names if name not in set(test))
    return Split(fit, test) if test and fit else Split(tuple(names), tuple(names))

"""A manoeuvre written beforehand: a pose for every step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Script:
    """Poses of a front bumper, one a step.

    Attributes:
        front: (k, 2) world metres.
        heading_rad: (k,).
    """

    front: np.ndarray
    heading_rad: np.ndarray

    def __len__(self) -> int:
        return len(self.front)

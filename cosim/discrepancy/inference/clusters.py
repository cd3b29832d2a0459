"""What beams share errors with: the thing or spot they meet, and their scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Clusters:
    """Clusters of n beams.

    Attributes:
        track: (n,) int: an instance, or a cell of the map.
        scan: (n,) int.
        part: (n,) int scan, or part of a scan where scans are few.
        unit_track, unit_scan: (m,) int which track or scan each random effect is of; −1 where it is of none.
    """

    track: np.ndarray
    scan: np.ndarray
    part: np.ndarray
    unit_track: np.ndarray
    unit_scan: np.ndarray

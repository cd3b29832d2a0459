"""Scans that are not stored in a drive, as frames for detectors."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Calibration, Frame
from sensors.cameras.kitti_rig import KITTI_CALIBRATION


def _no_points() -> np.ndarray:
    return np.zeros((0, 4), np.float32)


@dataclass(frozen=True, eq=False)
class Rescanned(Frame):
    """A frame of a drive with the points of another scan.

    Attributes:
        scan: (n, 4) float32 as in `points`.
    """

    scan: np.ndarray = field(default_factory=_no_points)

    @classmethod
    def of(cls, frame: Frame, scan: np.ndarray) -> Rescanned:
        """Replace the points of a frame."""
        return cls(**{item.name: getattr(frame, item.name) for item in fields(Frame)}, scan=scan)

    @cached_property
    def points(self) -> np.ndarray:
        """(n, 4) float32 x, y, z [m] in LiDAR axes and intensity."""
        return self.scan


class Bare(Rescanned):
    """A scan without cameras, labels or images; KITTI's camera defines the field of view."""

    @classmethod
    def named(cls, name: str, scan: np.ndarray) -> Bare:
        """Create a frame from a scan (n, 4)."""
        return cls(name, Path(), scan=scan)

    def find(self, part: str) -> Path | None:
        """Return None: there are no files."""
        return None

    @cached_property
    def calibration(self) -> Calibration:
        """KITTI's calibration of 2011-09-26."""
        return Calibration(**vars(KITTI_CALIBRATION))

"""Scans that are no frames of a drive on disk, in the form in which detectors take frames."""

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
    """A frame of a drive with the points of another scan of it.

    Attributes:
        scan: (n, 4) float32 as in `points`.
    """

    scan: np.ndarray = field(default_factory=_no_points)

    @classmethod
    def of(cls, frame: Frame, scan: np.ndarray) -> Rescanned:
        """That frame with those points."""
        return cls(**{item.name: getattr(frame, item.name) for item in fields(Frame)}, scan=scan)

    @cached_property
    def points(self) -> np.ndarray:
        """(n, 4) float32 x, y, z [m] in LiDAR axes and intensity."""
        return self.scan


class Bare(Rescanned):
    """A scan without cameras, labels or images: what KITTI's camera would see of it is looked at."""

    @classmethod
    def named(cls, name: str, scan: np.ndarray) -> Bare:
        """A scan (n, 4) of a name."""
        return cls(name, Path(), scan=scan)

    def find(self, part: str) -> Path | None:
        """No file of any part."""
        return None

    @cached_property
    def calibration(self) -> Calibration:
        """KITTI's of 2011-09-26."""
        return Calibration(**vars(KITTI_CALIBRATION))

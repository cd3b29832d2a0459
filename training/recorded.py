"""Scans of a recording as input of a detector, shifted to the LiDAR height of its training data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Calibration, Labels, write_calibration
from cosim.drives.writer import explained
from cosim.recordings import Recording
from cosim.recordings.scan import Scan
from sensors.cameras.kitti_rig import KITTI_CALIBRATION, LIDAR_IN_EGO_M
from training.data.views import Bare

#: Height of the LiDAR above the ground in KITTI's rig, and in drives of the rig `kitti` [m].
LEARNT_HEIGHT_M = LIDAR_IN_EGO_M[2]
_RING_M = (4.0, 15.0)  # horizontal range of ground points: nearer is the ego vehicle
_BELOW_M = (0.3, 6.0)
_BIN_M = 0.1
_SCANS = 10


@dataclass(frozen=True, eq=False)
class RecordedFrames:
    """Scans of a recording; KITTI's camera defines the field of view.

    Attributes:
        recording: scans with x forward, z up.
        height_m: height of the sensor above the ground.
    """

    recording: Recording
    height_m: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the frames: those of the scans, or their numbers if two scans have the same name."""
        stems = tuple(Path(name).stem for name in self.recording.names)
        return stems if len(set(stems)) == len(stems) else tuple(f"{row:06d}" for row in range(len(stems)))

    def __iter__(self) -> Iterator[Bare]:
        lift = LEARNT_HEIGHT_M - self.height_m
        for name, scan in zip(self.names, self.recording, strict=True):
            intensity = np.zeros(len(scan)) if scan.intensity is None else scan.intensity
            yield Bare.named(name, np.column_stack([scan.xyz - [0, 0, lift], intensity]).astype(np.float32))

    def lowered(self, heights: Labels) -> Labels:
        """Shift detections to the axes of the recording's sensor."""
        return replace(heights, location=heights.location - [0, LEARNT_HEIGHT_M - self.height_m, 0])


def height_above_ground(recording: Recording) -> float | None:
    """Sensor height: from its mount, otherwise the most frequent depth of points around it [m]; None: no points."""
    if recording.settings.mount is not None:
        return recording.settings.mount.height_m
    heights = [height for scan in islice(recording, _SCANS) if (height := _estimate_height(scan)) is not None]
    return float(np.median(heights)) if heights else None


def write_calibrations(folder: Path, names: Sequence[str]) -> None:
    """Write the calibration that detections in recordings refer to, one KITTI file per frame.

    Raises:
        OutputError: the folder cannot be written.
    """
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in names:
            write_calibration(folder / f"{name}.txt", Calibration(**vars(KITTI_CALIBRATION)))


def _estimate_height(scan: Scan) -> float | None:
    depth = -scan.xyz[(scan.flat_range_m > _RING_M[0]) & (scan.flat_range_m < _RING_M[1]), 2]
    depth = depth[(depth > _BELOW_M[0]) & (depth < _BELOW_M[1])]
    if not len(depth):
        return None
    counts, edges = np.histogram(depth, np.arange(_BELOW_M[0], _BELOW_M[1] + _BIN_M, _BIN_M))
    mode_m = edges[counts.argmax()] + _BIN_M / 2
    return float(np.median(depth[np.abs(depth - mode_m) < _BIN_M]))

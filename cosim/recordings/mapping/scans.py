"""Points of scans as a map takes them: thinned, with the part of the sweep at which each was measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.recordings.mapping.motion import applied, deskewed, scan_times
from cosim.recordings.mapping.surfels import Cloud
from cosim.recordings.recording import Recording
from cosim.recordings.scan import Scan

_NEAREST_M, _FARTHEST_M = 2.0, 60.0
_MOST_POINTS, _MOST_A_SCAN = 4_000_000, 30_000  # in the map; more points make it slower without much benefit


@dataclass(frozen=True, eq=False)
class LocalScan:
    """The points of a scan that go into the map.

    Attributes:
        xyz: (n, 3) float32 in the sensor's axes at each point's own time [m].
        share: (n,) float32 times from the pose time, in sweeps.
        intensity: (n,) float32; zeros where there is none.
    """

    xyz: np.ndarray
    share: np.ndarray
    intensity: np.ndarray

    def __len__(self) -> int:
        return len(self.xyz)

    def at_pose_time(self, motion: np.ndarray) -> np.ndarray:
        """(n, 3) float32 points in the sensor's axes at the pose time, for its motion (6,) in a sweep."""
        return deskewed(self.xyz, self.share, motion).astype(np.float32)

    def thinned(self, share: float) -> LocalScan:
        """A part of the points."""
        rows = thinned(len(self), round(share * len(self)))
        return LocalScan(self.xyz[rows], self.share[rows], self.intensity[rows])


def in_turn(scan: Scan) -> Scan:
    """A scan with its points as the head turns, so that nothing depends on their order in the file."""
    return scan[np.argsort(-scan.azimuth_rad, kind="stable")]


def thinned(count: int, most: int) -> np.ndarray:
    """So many rows of `count` at most, any, in order: every so manieth might be of the same few lasers."""
    if count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False, shuffle=False))


def local_scans(recording: Recording, sweep_s: float, on_scan: Callable[[], object] = lambda: None) -> list[LocalScan]:
    """Scans of a recording, all subsampled equally so that the map has a limited size.

    Args:
        recording: scans in order.
        sweep_s: duration of a turn.
        on_scan: called after each is read.
    """
    scans: list[LocalScan] = []
    most = min(_MOST_POINTS // max(len(recording), 1), _MOST_A_SCAN)
    for unordered in recording:
        scan = in_turn(unordered)
        reach = np.linalg.norm(scan.xyz, axis=1)
        rows = np.flatnonzero((reach > _NEAREST_M) & (reach < _FARTHEST_M))
        rows = rows[thinned(len(rows), most)]
        share = scan_times(scan.azimuth_rad, scan.time_s, sweep_s)[rows] / sweep_s
        bright = np.zeros(len(rows), np.float32) if scan.intensity is None else scan.intensity[rows]
        scans.append(LocalScan(scan.xyz[rows].astype(np.float32), share.astype(np.float32), bright))
        on_scan()
    return scans


def cloud_of(scans: Sequence[LocalScan], poses: np.ndarray, motion: np.ndarray, numbers: Sequence[int]) -> Cloud:
    """The points of some scans in world axes.

    Args:
        scans: all of them.
        poses: (n, 4, 4) of the sensor.
        motion: (n, 6) of the sensor in a sweep that points are freed of.
        numbers: which scans.
    """
    xyz, ray, reach, elevation = [], [], [], []
    for number in numbers:
        world = applied(poses[number], scans[number].at_pose_time(motion[number]))
        beam = world - poses[number, :3, 3]
        away = np.linalg.norm(beam, axis=1)
        xyz.append(world.astype(np.float32))
        ray.append((beam / away[:, None]).astype(np.float32))
        reach.append(away.astype(np.float32))
        sent = scans[number].xyz
        elevation.append(np.degrees(np.arctan2(sent[:, 2], np.hypot(sent[:, 0], sent[:, 1]))))
    sizes = [len(part) for part in xyz]
    return Cloud(
        np.concatenate(xyz),
        np.repeat(np.array(numbers, np.int32), sizes),
        np.concatenate(reach),
        np.concatenate(ray),
        np.concatenate(elevation),
        np.concatenate([scans[number].intensity for number in numbers]),
    )

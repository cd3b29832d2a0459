"""LiDAR odometry: pose of the sensor at each scan, from the scans only.

KISS-ICP (Vizzo et al., RA-L 8, 2023) places scan after scan on a local map. Scans are freed of the sensor's own motion
before: first by the motion from the scan before, then, in a second pass, by the poses of the first. Level ground takes
no part where enough else is seen: its rings travel with the sensor, and pull matching of points towards standing still.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosim.recordings.libraries import needed
from cosim.recordings.mapping.motion import between, deskewed, motions, scan_times
from cosim.recordings.mapping.scans import in_turn
from cosim.recordings.recording import Recording

_NEAREST_M, _FARTHEST_M = 2.0, 80.0
_JUMP = 4.0  # times the usual change of motion from scan to scan that is a jump of the odometry
_LEAST_JUMP_M = 0.5
_STANDING_M = 1.0
_GROUND_REACH_M, _GROUND_BAND_M, _GROUND_SLOPE, _LEAST_LEFT = 25.0, 0.3, 0.02, 0.2


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of a recording.

    Attributes:
        poses: (n, 4, 4) of the sensor at the pose times, in the axes of the first.
        motion: (n, 6) of the sensor in a sweep, in its own axes: rotation vector [rad], translation [m].
        doubtful: numbers of scans at which the path jumps.
        source: where the poses come from, in words.
        turns: (n,) sweeps that the head has made since the first scan.
        from_odometry: whether the poses were found in the points.
    """

    poses: np.ndarray
    motion: np.ndarray
    doubtful: tuple[int, ...]
    source: str
    turns: np.ndarray
    from_odometry: bool = True

    @property
    def path_m(self) -> float:
        """Length of the path."""
        return float(np.linalg.norm(np.diff(self.poses[:, :3, 3], axis=0), axis=1).sum())

    @property
    def extent_m(self) -> float:
        """Largest distance from the first place."""
        return float(np.linalg.norm(self.poses[:, :3, 3] - self.poses[0, :3, 3], axis=1).max())

    @property
    def standing(self) -> bool:
        """Whether the sensor stays where it is."""
        return self.extent_m < _STANDING_M


def find_trajectory(recording: Recording, sweep_s: float, on_scan: Callable[[], object] = lambda: None) -> Trajectory:
    """The recording's own poses, or those of odometry.

    Args:
        recording: scans in order.
        sweep_s: duration of a turn.
        on_scan: called after each scan of each pass.

    Raises:
        RecordingError: `kiss-icp` is not installed, or a scan is damaged.
    """
    turns = recording.turns(sweep_s)
    if recording.poses is not None:
        for _ in range(2 * len(recording)):
            on_scan()
        return _described(recording.poses, turns, "given with the recording", from_odometry=False)
    poses = _register(recording, sweep_s, turns, None, on_scan)
    poses = _register(recording, sweep_s, turns, poses, on_scan)
    return _described(poses, turns, "odometry (KISS-ICP)")


def _register(
    recording: Recording, sweep_s: float, turns: np.ndarray, known: np.ndarray | None, on_scan: Callable[[], object]
) -> np.ndarray:
    config = needed("kiss_icp.config", "odometry").load_config(None)
    config.data.deskew, config.data.min_range, config.data.max_range = False, _NEAREST_M, _FARTHEST_M
    config.registration.max_num_threads = 1  # sums in one order: the same poses every time
    odometry = needed("kiss_icp.kiss_icp", "odometry").KissICP(config)
    steps = None if known is None else motions(known, turns)
    poses: list[np.ndarray] = []
    for number, unordered in enumerate(recording):
        scan = in_turn(unordered)
        if steps is not None:
            motion = steps[number]
        else:
            motion = between(poses[-2], poses[-1]) if len(poses) > 1 else np.zeros(6)
            motion /= max(turns[number - 1] - turns[number - 2], 0.5) if len(poses) > 1 else 1.0
        share = scan_times(scan.azimuth_rad, scan.time_s, sweep_s) / sweep_s
        if len(scan):
            odometry.register_frame(_without_ground(deskewed(scan.xyz, share, motion)), np.zeros(0))
        poses.append(np.array(odometry.last_pose))
        on_scan()
    found = np.array(poses)
    return np.linalg.inv(found[0]) @ found


def _without_ground(xyz: np.ndarray) -> np.ndarray:
    """Points (n, 3) of a scan but those about the commonest height below the sensor, if a fifth is left.

    The band widens with distance by one in fifty: beams that look a degree higher than they are said to draw level
    ground as a cone, whose far rings would travel with the sensor.
    """
    away = np.hypot(xyz[:, 0], xyz[:, 1])
    near = xyz[(away < _GROUND_REACH_M) & (xyz[:, 2] < -_GROUND_BAND_M), 2]
    if not len(near):
        return xyz
    counts, edges = np.histogram(near, np.arange(-6.0, 0.1, 0.1))
    ground = edges[counts.argmax()] + 0.05
    kept = np.abs(xyz[:, 2] - ground) > _GROUND_BAND_M + _GROUND_SLOPE * away
    return xyz[kept] if kept.mean() > _LEAST_LEFT else xyz


def _described(poses: np.ndarray, turns: np.ndarray, source: str, *, from_odometry: bool = True) -> Trajectory:
    step = np.diff(poses[:, :3, 3], axis=0) / np.maximum(np.diff(turns), 0.5)[:, None]
    change = np.linalg.norm(np.diff(step, axis=0), axis=1) if len(step) > 1 else np.zeros(0)
    limit = max(_LEAST_JUMP_M, _JUMP * float(np.median(change))) if len(change) else np.inf
    doubtful = tuple(int(row) + 2 for row in np.flatnonzero(change > limit))
    return Trajectory(poses, motions(poses, turns), doubtful, source, turns, from_odometry)

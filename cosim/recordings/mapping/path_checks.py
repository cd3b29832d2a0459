"""Checks of the path of the sensor: direction of travel, order of scans, places, poses, missing scans by distance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree

from cosim.recordings.checks import raise_findings
from cosim.recordings.mapping.motion import applied, motions
from cosim.recordings.mapping.odometry import Trajectory, find_trajectory
from cosim.recordings.mapping.sweep import SweepEstimate
from cosim.recordings.recording import Recording
from cosim.recordings.scan import Scan

_ASIDE_DEG = 30.0  # of the direction of travel from the x axis
_FARTHEST_M = 40.0  # of points that neighbouring scans are compared by
_MEETS_M = 0.5  # from a point of the scan before, within which a point meets it
_POINTS, _PAIRS = 3000, 60
_LEAST_MET = 0.5  # share of points that meet the scan before, in the usual scan
_TORN = 0.6  # of the usual share, below which a scan shows another place
_BETTER = 0.15  # share of points by which odometry must do better than given poses
_TRIED = 12  # scans that it is tried on
_LONG_STEP = (1.7, 4.3)  # times its neighbours, of a step over missing scans
_LEAST_STEP_M = 0.2


def check_path(recording: Recording, path: Trajectory, accepted: Sequence[str] = ()) -> list[str]:
    """Check a path against the points; returns notes.

    Args:
        recording: scans in order.
        path: of the sensor.
        accepted: names of checks whose findings are notes.

    Raises:
        RecordingError: a check finds something that is not accepted.
    """
    rows = np.unique(np.linspace(1, len(recording) - 1, min(len(recording) - 1, _PAIRS)).round().astype(int))
    rows = np.unique([*rows, *(row for row in path.doubtful if row > 0)])
    met = np.array(
        [met_share(recording[row - 1], recording[row], path.poses[row - 1], path.poses[row]) for row in rows]
    )
    findings = {"poses": _poses(recording, path, float(np.median(met)))}
    if not findings["poses"]:
        findings["places"] = _places(recording, rows, met)
        findings["travel"] = _travel(path)
    return [*raise_findings(recording, findings, accepted), *_long_steps(recording, path)]


def check_sweep(
    recording: Recording, path: Trajectory, sweep: SweepEstimate | None, accepted: Sequence[str] = ()
) -> list[str]:
    """Check that points move with the path, and that x points along it, not against it; returns notes.

    Raises:
        RecordingError: they do not.
    """
    backwards = not path.standing and abs(travel_deg(path)) > 180 - _ASIDE_DEG
    reversed_ = sweep is not None and sweep.is_reversed
    if not backwards and not reversed_:
        return []
    findings = {"travel": "", "order": ""}
    if sweep is not None and reversed_:
        strength = f"{sweep.strength:.2f} of its motion in a sweep, {sweep.low:.2f} to {sweep.high:.2f}"
        findings["order"] = f"the points move against the path ({strength}): " + (
            "the scans are in reverse order, as the path runs backwards, too; put them in order of time"
            if backwards
            else "the points are mirrored, or their times run backwards; state the axes with --flip-y or --axes"
        )
    elif backwards:
        findings["travel"] = (
            f"the sensor travels against its x axis (azimuth {travel_deg(path):+.0f}°), which must point forward: "
            "state the axes with --axes -x,-y,z, or the vehicle reverses, or the scans are in reverse order"
        )
    return raise_findings(recording, findings, accepted)


def met_share(first: Scan, second: Scan, pose: np.ndarray, later: np.ndarray) -> float:
    """Share of the near points of a scan that lie next to points of another one, under their poses (4, 4)."""
    one, other = (_near(scan) for scan in (first, second))
    if not len(one) or not len(other):
        return 0.0
    thin = other[:: max(1, len(other) // _POINTS)]
    away, _ = KDTree(applied(pose, one[:: max(1, len(one) // (10 * _POINTS))])).query(
        applied(later, thin), distance_upper_bound=_MEETS_M
    )
    return float(np.mean(np.isfinite(away)))


def _near(scan: Scan) -> np.ndarray:
    reach = np.linalg.norm(scan.xyz, axis=1)
    return scan.xyz[(reach > 2.0) & (reach < _FARTHEST_M)]


def _poses(recording: Recording, path: Trajectory, met: float) -> str:
    """Given poses that bring scans together much worse than odometry does.

    Scans are compared over half of the part, because wrong turns or a mirrored path add up from scan to scan.
    """
    if path.from_odometry:
        return ""
    count = min(len(recording), _TRIED)
    step = np.linalg.norm(np.diff(path.poses[:, :3, 3], axis=0), axis=1)
    sums = np.convolve(step, np.ones(count - 1), "valid")
    first = int(np.argmax(sums))
    part = recording.between(first, first + count)
    own = find_trajectory(part.without_poses(), 0.1)
    window = path.poses[first : first + count]
    given = np.mean(_met(part, window))
    found = np.mean(_met(part, own.poses))
    if found - given < _BETTER:
        return ""
    turned = _rotation_between(window, own.poses)
    how = f", and agree after a turn of {turned:.0f}°" if turned > 2 else ""
    lengths = [float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum()) for poses in (window, own.poses)]
    return (
        f"under the given poses {given:.0%} of the points of a scan meet those of the scan {count // 2} before, under "
        f"odometry's {found:.0%}{how}; their path is {lengths[0]:.1f} m long, odometry's {lengths[1]:.1f} m: the poses "
        "are of another frame (vehicle, IMU, camera, or mirrored), unit or recording; give poses of the LiDAR [m], or "
        "none"
    )


def _met(part: Recording, poses: np.ndarray) -> list[float]:
    """Shares of the points of scans that meet those of the scan half of the part before."""
    apart = max(1, len(part) // 2)
    return [met_share(part[row - apart], part[row], poses[row - apart], poses[row]) for row in range(apart, len(part))]


def _rotation_between(given: np.ndarray, estimated: np.ndarray) -> float:
    """Angle [deg] of the rotation that turns the steps of one path best into those of another."""
    left, right = motions(given)[:, 3:], motions(estimated)[:, 3:]
    u, _, v = np.linalg.svd(left.T @ right)
    turn = (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v).T
    return float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))))


def _places(recording: Recording, rows: np.ndarray, met: np.ndarray) -> str:
    usual = float(np.median(met))
    if usual < _LEAST_MET:
        return (
            f"neighbouring scans do not show the same surroundings: under odometry's poses {usual:.0%} of the points "
            "meet the scan before; they are of several sensors or places in turn, in disorder, or far apart: give the "
            "scans of one drive in order"
        )
    torn = rows[met < _TORN * usual]
    if not len(torn):
        return ""
    row, share = int(torn[0]), float(met[rows == torn[0]][0])
    return (
        f"scan {recording.names[row]} shows another place than {recording.names[row - 1]} before it: {share:.0%} of "
        f"its points meet those of that scan, usually {usual:.0%}; {len(torn)} such places: give the scans of one "
        "drive, as with --scans, or several drives as several recordings"
    )


def travel_deg(path: Trajectory) -> float:
    """Azimuth [°] of the direction of travel in the sensor's axes."""
    step = path.motion[:, 3:]
    length = np.linalg.norm(step, axis=1)
    mean = step[length > 0.2 * np.quantile(length, 0.9)].sum(0)
    return float(np.degrees(np.arctan2(mean[1], mean[0])))


def _travel(path: Trajectory) -> str:
    """Whether the path runs to the left or right of x; paths along −x are handled with the motion in a sweep."""
    azimuth = 0.0 if path.standing else travel_deg(path)
    if abs(azimuth) < _ASIDE_DEG or abs(azimuth) > 180 - _ASIDE_DEG:
        return ""
    axis, axes = ("y", "y,-x,z") if azimuth > 0 else ("-y", "-y,x,z")
    return (
        f"the sensor travels along its {axis} axis (azimuth {azimuth:+.0f}°), where x must point forward: state the "
        f"axes with --axes {axes}, or the sensor is mounted so"
    )


def _long_steps(recording: Recording, path: Trajectory) -> list[str]:
    """A note on steps that are a multiple of their neighbours', as where scans were dropped."""
    step = np.linalg.norm(np.diff(path.poses[:, :3, 3], axis=0), axis=1) / np.maximum(np.diff(path.turns), 0.5)
    if len(step) < 5:
        return []
    around = np.array([np.median(np.delete(step[max(n - 3, 0) : n + 4], min(n, 3))) for n in range(len(step))])
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.where(around > _LEAST_STEP_M, step / around, 1.0)
    rows = np.flatnonzero((times > _LONG_STEP[0]) & (times < _LONG_STEP[1]))
    if not len(rows):
        return []
    lost = int(np.round(times[rows] - 1).sum())
    first, second = recording.names[rows[0]], recording.names[rows[0] + 1]
    return [
        f"about {lost} scans are missing by the distances travelled, the first between {first} and {second} "
        f"({times[rows[0]]:.1f} times the usual step)"
    ]

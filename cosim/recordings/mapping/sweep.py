"""Test of motion compensation: share of the sensor's motion in a sweep that the points contain, with an interval.

Two independent clues. Points of a laser that spins lie on a cone about the sensor's axis as they are measured; what is
freed of motion leaves it. The strength of the motion is one more unknown besides poses and positions of surfaces:
1 in points as measured, 0 in compensated ones, −1 where scans or times are in reverse order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import stats

from cosim.recordings.mapping.adjust import adjusted, adjusted_with_sweep, placed_in_turn
from cosim.recordings.mapping.motion import deskewed, scan_times
from cosim.recordings.mapping.odometry import Trajectory
from cosim.recordings.mapping.scans import LocalScan, cloud_of, local_scans
from cosim.recordings.mapping.surfels import SurfelSettings, make_surfels
from cosim.recordings.pattern.lasers import nearest_laser
from cosim.recordings.recording import Recording

_WINDOW, _MOST_WINDOWS, _STEPS = 10, 4, 5
_THICKEST_M = 0.1  # so that cells are not left out where the motion is taken wrongly
_FEWEST_SURFELS = 50
_CONE_SCANS, _ON_CONE_DEG, _NEAR_M, _FAR_M = 6, 0.06, 3.0, 20.0
_CLEAR_SHARE = 0.1  # of points that leave or reach the cones, by which the cones decide
_ONE = 0.15  # from 1, within which a strength is that of points as measured
_CLEARLY_LESS = 0.5  # than the motion of points as measured
_UPPER = 0.975

Answer = Literal["yes", "no", "cannot be determined"]


@dataclass(frozen=True, eq=False)
class SweepEstimate:
    """Share of the sensor's motion in a sweep that the points contain.

    Attributes:
        strength: mean of the windows.
        low, high: its 95 % interval.
        windows: (w,) strengths of stretches of the recording, each with a map of its own.
        cones: shares of points on their laser's cone: as they are, with the motion undone, and with it put back.
        thickness_m: of upright surfaces of one stretch [m], with the motion taken so many times as strong.
    """

    strength: float
    low: float
    high: float
    windows: np.ndarray
    cones: tuple[float, float, float]
    thickness_m: dict[float, float]

    @property
    def is_compensated(self) -> Answer:
        """Whether points were freed of the motion before."""
        by_cones = self._by_cones
        if by_cones is not None:
            return by_cones
        has_none, has_all = self.low <= 0 <= self.high, self.low <= 1 <= self.high
        if has_none == has_all:
            return "cannot be determined"
        return "yes" if has_none else "no"

    @property
    def is_without_motion(self) -> bool:
        """Whether the strength shows that points contain none of the sensor's motion, compensated or not."""
        return self.low <= 0 <= self.high and self.high < _CLEARLY_LESS

    @property
    def _by_cones(self) -> Answer | None:
        as_is, undone, put_back = self.cones
        if as_is - undone > _CLEAR_SHARE and as_is >= put_back:
            return "no"
        return "yes" if put_back - as_is > _CLEAR_SHARE else None

    @property
    def is_reversed(self) -> bool:
        """Whether points move against the path."""
        return self.high < 0 and self.low <= -0.5

    @property
    def scale(self) -> float:
        """Motion to remove from the points, in motions from scan to scan: usually 1.

        0 if points are compensated, or contain no motion as they were measured: those of a simulated sensor that
        measures all directions at once also lie on the cones.
        """
        if self.is_compensated == "yes" or self.is_without_motion:
            return 0.0
        if self.is_compensated == "cannot be determined":
            return float(self.strength > 0.5)
        is_one = self.low <= 1 <= self.high or abs(self.strength - 1) < _ONE
        return 1.0 if is_one or not 0.2 < self.strength < 2 else self.strength

    @property
    def evidence(self) -> str:
        """A sentence."""
        as_is, undone, put_back = self.cones
        message = (
            f"fitted along with poses and surfaces, the motion in the points is {self.strength:.2f} "
            f"({self.low:.2f} to {self.high:.2f}) of that of the sensor (1: as measured, 0: compensated)"
        )
        if max(abs(as_is - undone), abs(as_is - put_back)) > 0.01:
            message += (
                f"; {as_is:.0%} of the near points lie on their laser's cone as they are, {undone:.0%} with the motion "
                f"undone and {put_back:.0%} with it put back"
            )
        if self.is_without_motion and self.is_compensated == "no":
            message += "; they contain no motion, as of a simulated sensor without a sweep, and none is removed"
        return message


def sweep_motion(
    recording: Recording, trajectory: Trajectory, lines: np.ndarray, sweep_s: float, settings: SurfelSettings
) -> SweepEstimate:
    """Estimate the share of the motion in a sweep that the points contain.

    Args:
        recording: scans in order.
        trajectory: their poses and motion.
        lines: (k, 2) cones of the lasers, see `Lasers.lines`.
        sweep_s: duration of a turn.
        settings: of surfels.
    """
    firsts = _windows(trajectory)
    settings = replace(settings, thickest_m=_THICKEST_M)
    found, errors, thick = [], [], {}
    for turn, first in enumerate(firsts):
        rows = slice(first, first + min(_WINDOW, len(recording)))
        scans = local_scans(recording.between(rows.start, rows.stop), sweep_s)
        own = replace(
            trajectory, poses=trajectory.poses[rows], motion=trajectory.motion[rows], turns=trajectory.turns[rows]
        )
        numbers = [number for number in range(len(scans)) if len(scans[number])]
        strength, error = _strength(scans, own, numbers, settings)
        found.append(strength)
        errors.append(error)
        if turn == 0:
            thick = {scale: _upright_m(scans, own, scale, numbers, settings) for scale in (0.0, 1.0)}
    mean, half = _combined(np.array(found), np.array(errors))
    cones = _cones(recording, trajectory, lines, sweep_s)
    return SweepEstimate(mean, mean - half, mean + half, np.array(found), cones, thick)


def _windows(trajectory: Trajectory) -> list[int]:
    """First scans of stretches that do not overlap, those with the most motion first."""
    count = len(trajectory.poses)
    size = min(_WINDOW, count)
    starts = np.unique(np.linspace(0, count - size, max(count // size, 1)).astype(int))
    step = np.linalg.norm(trajectory.motion[:, 3:], axis=1)
    moved = [float(step[start : start + size].sum()) for start in starts]
    return [int(starts[row]) for row in np.argsort(moved)[::-1][:_MOST_WINDOWS]]


def _strength(
    scans: Sequence[LocalScan], own: Trajectory, numbers: Sequence[int], settings: SurfelSettings
) -> tuple[float, float]:
    """Maximum-likelihood strength in a section and its standard error."""
    strength, error = 1.0, np.inf
    poses = _initial_poses(scans, own, strength, numbers)
    for _ in range(_STEPS):
        surfels, _ = make_surfels(cloud_of(scans, poses, strength * own.motion, numbers), settings)
        if len(surfels) < _FEWEST_SURFELS:
            break
        poses, strength, error = adjusted_with_sweep(
            scans, poses, own.motion, strength, numbers, surfels, settings.cell_m
        )
    return strength, error


def _combined(values: np.ndarray, errors: np.ndarray) -> tuple[float, float]:
    """Mean and half width of its 95 % interval of values (w,) with standard errors (w,).

    Weights of the random-effects model (DerSimonian and Laird, Controlled Clinical Trials 7, 1986); Student's t.
    """
    known = np.isfinite(errors) & (errors > 0)
    if not known.any():
        return float(np.mean(values)), np.inf
    values, weight = values[known], 1 / errors[known] ** 2
    count = len(values)
    if count == 1:
        return float(values[0]), float(stats.norm.ppf(_UPPER) * errors[known][0])
    mean = weight @ values / weight.sum()
    excess = weight @ (values - mean) ** 2 - (count - 1)
    between = max(excess / (weight.sum() - (weight**2).sum() / weight.sum()), 0.0)
    weight = 1 / (1 / weight + between)
    freedom = count - 1 if between > 0 else 10**6
    return float(weight @ values / weight.sum()), float(stats.t.ppf(_UPPER, freedom) / np.sqrt(weight.sum()))


def _cones(
    recording: Recording, trajectory: Trajectory, lines: np.ndarray, sweep_s: float
) -> tuple[float, float, float]:
    """Shares of near points on their laser's cone: as they are, with the motion undone, with it put back."""
    step = np.linalg.norm(trajectory.motion[:, 3:], axis=1)
    totals, points = np.zeros(3), 0
    for number in np.argsort(step)[::-1][:_CONE_SCANS]:
        scan = recording[int(number)]
        near = (scan.flat_range_m > _NEAR_M) & (scan.flat_range_m < _FAR_M)
        xyz, motion = scan.xyz[near], trajectory.motion[number]
        share = scan_times(scan.azimuth_rad, scan.time_s, sweep_s)[near] / sweep_s
        for row, moved in enumerate((xyz, deskewed(xyz, share, motion), deskewed(xyz, share, -motion))):
            _, off = nearest_laser(np.hypot(moved[:, 0], moved[:, 1]), moved[:, 2], lines)
            totals[row] += np.count_nonzero(np.abs(off) < np.radians(_ON_CONE_DEG))
        points += len(xyz)
    as_is, undone, put_back = (totals / max(points, 1)).tolist()
    return as_is, undone, put_back


def _initial_poses(scans: Sequence[LocalScan], own: Trajectory, scale: float, numbers: Sequence[int]) -> np.ndarray:
    """Initial poses if this strength of motion is removed from the points."""
    return placed_in_turn(scans, own.poses, scale * own.motion, numbers) if own.from_odometry else own.poses


def _upright_m(
    scans: Sequence[LocalScan], own: Trajectory, scale: float, numbers: Sequence[int], settings: SurfelSettings
) -> float:
    """Thickness of upright surfaces, of all where there are few, in a map of points freed of so much motion."""
    motion, poses = scale * own.motion, _initial_poses(scans, own, scale, numbers)
    surfels, _ = make_surfels(cloud_of(scans, poses, motion, numbers), settings)
    if len(surfels) >= _FEWEST_SURFELS:
        poses = adjusted(scans, poses, motion, numbers, surfels, settings.cell_m)
        surfels, _ = make_surfels(cloud_of(scans, poses, motion, numbers), settings)
    upright = ~surfels.level()
    rows = upright if upright.sum() >= _FEWEST_SURFELS else ~np.zeros(len(surfels), bool)
    return float(np.median(surfels.sd_m[rows])) if len(surfels) else float("nan")

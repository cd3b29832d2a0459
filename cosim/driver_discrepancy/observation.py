"""How trajectories were measured: sampling, position noise, and speeds that are derived from positions.

Measured and simulated trajectories pass the same steps before they are compared.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim.driver_discrepancy.placed import Placed
from cosim.driver_discrepancy.tracks import Tracks, take_rows, without_empty

_NOTICED_M = 0.015
_SMOOTHS_S = 1.2
_MOVES_MPS = 3.0
_OFF_SHARE, _OFF = 0.05, 0.05  # share of the samples that may lie off the common instants, and by which share of a step
_GAP = 1.6  # usual steps between two samples, from which a track is interrupted


@dataclass(frozen=True)
class Observation:
    """The measurement of trajectories.

    Attributes:
        noise_m: standard deviation of each coordinate; 0 where none can be seen.
        derives_speed: speeds are not measured but derived from positions.
    """

    noise_m: float = 0.0
    derives_speed: bool = False

    def apply(self, tracks: Tracks, seed: int) -> Tracks:
        """Simulated trajectories as they would have been measured: with noise, then processed as measured ones."""
        if self.noise_m > 0 and len(tracks):
            rng = np.random.default_rng([seed, 8])
            tracks = replace(tracks, place=tracks.place + rng.normal(0, self.noise_m, tracks.place.shape))
        return self.process(tracks)

    def process(self, tracks: Tracks) -> Tracks:
        """Positions by local cubic polynomials and speeds as their derivative (Savitzky and Golay 1964).

        Trajectories without noise whose speeds were measured remain as they are.
        """
        from scipy.signal import savgol_filter

        if not len(tracks) or (self.noise_m == 0 and not self.derives_speed):
            return tracks
        step_s = max(tracks.step_s, 1e-3)
        longest = max(5, 2 * round(_SMOOTHS_S / step_s / 2) + 1)
        position, speed = tracks.place.copy(), tracks.speed_mps.copy()
        interrupted = (np.diff(tracks.vehicle) != 0) | (np.diff(tracks.time_s) > _GAP * step_s)
        ends = np.concatenate([[0], np.flatnonzero(interrupted) + 1, [len(tracks)]])
        for start, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
            window = min(longest, end - start - (end - start + 1) % 2)  # odd
            if window < 5:
                continue
            part = tracks.place[start:end]
            position[start:end] = savgol_filter(part, window, 3, axis=0)
            velocity = np.asarray(savgol_filter(part, window, 3, deriv=1, delta=step_s, axis=0), float)
            speed[start:end] = np.hypot(velocity[:, 0], velocity[:, 1])
        slow = max(3 * self.noise_m / _SMOOTHS_S, 0.1)
        return replace(tracks, place=position, speed_mps=np.where(speed < slow, 0.0, speed))


def estimate_observation(placed: Placed) -> Observation:
    """Estimate the noise of positions from second differences of the lateral position on straight lanes.

    Noise of less than 15 mm is left out unless speeds are derived from positions, where it shows.
    """
    tracks, left = placed.tracks, placed.left_m
    same = (tracks.vehicle[2:] == tracks.vehicle[:-2]) & (placed.code[2:] == placed.code[:-2])
    good = same & placed.free_lane[1:-1] & (tracks.speed_mps[1:-1] > _MOVES_MPS)
    if good.sum() < 200:
        return Observation(derives_speed=tracks.derives_speed)
    second = left[2:][good] - 2 * left[1:-1][good] + left[:-2][good]
    noise = 1.4826 * float(np.median(np.abs(second))) / np.sqrt(6)
    noticed = noise > _NOTICED_M or tracks.derives_speed
    return Observation(noise if noticed else 0.0, tracks.derives_speed)


def resample(tracks: Tracks, step_s: float) -> tuple[Tracks, list[str]]:
    """Interpolate trajectories at multiples of the simulation's step, which simulated ones are sampled at.

    Args:
        tracks: measured trajectories.
        step_s: of the simulation [s].

    Returns:
        Trajectories with a sample at most every `step_s` or, if they are sampled less often, the next multiple of it;
        and a note if they were changed.
    """
    step = max(1, int(np.ceil(tracks.step_s / step_s - _OFF))) * step_s
    tick = (tracks.time_s - tracks.start_s) / step
    off = np.abs(tick - np.round(tick)) > _OFF
    number = np.floor(tick + 1e-6)
    same = np.diff(tracks.vehicle) == 0
    if off.mean() <= _OFF_SHARE and (np.diff(np.round(tick))[same] > 0).all():
        return tracks, []
    # The first sample at or after each instant moves back to it along the line from the sample before.
    new = np.concatenate([[False], same & (np.diff(number) > 0)])
    first = np.concatenate([[True], ~same]) & (np.abs(tick - np.round(tick)) < 1e-3)
    at = np.where(first, np.round(tick), number)
    before = np.maximum(np.arange(len(tracks)) - 1, 0)
    time_s = tracks.start_s + at * step
    gap = tracks.time_s - tracks.time_s[before]
    share = np.where(new, (time_s - tracks.time_s[before]) / np.where(gap > 0, gap, 1), 1.0)
    turn = np.angle(np.exp(1j * (tracks.heading_rad - tracks.heading_rad[before])))
    moved = replace(
        tracks,
        time_s=time_s,
        place=tracks.place[before] + share[:, None] * (tracks.place - tracks.place[before]),
        speed_mps=tracks.speed_mps[before] + share * (tracks.speed_mps - tracks.speed_mps[before]),
        heading_rad=tracks.heading_rad - (1 - share) * turn,
    )
    kept = take_rows(moved, new | first)
    note = f"samples every {tracks.step_s:.3g} s were interpolated at multiples of {step:.3g} s"
    return without_empty(kept), [note]

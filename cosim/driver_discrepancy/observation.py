"""How trajectories were measured: position noise, which simulated trajectories get as well before they are compared."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim.driver_discrepancy.placed import Placed
from cosim.driver_discrepancy.tracks import Tracks

_NOTICED_M = 0.015
_SMOOTHS_S = 1.2
_MOVES_MPS = 3.0


@dataclass(frozen=True)
class Observation:
    """The measurement of positions.

    Attributes:
        noise_m: standard deviation of each coordinate; 0 where none can be seen.
    """

    noise_m: float = 0.0

    def apply(self, tracks: Tracks, seed: int) -> Tracks:
        """Simulated trajectories as they would have been measured: with noise, then smoothed."""
        if self.noise_m == 0 or not len(tracks):
            return tracks
        rng = np.random.default_rng([seed, 8])
        return self.smooth(replace(tracks, place=tracks.place + rng.normal(0, self.noise_m, tracks.place.shape)))

    def smooth(self, tracks: Tracks) -> Tracks:
        """Positions by local cubic polynomials and speeds as their derivative (Savitzky and Golay 1964)."""
        from scipy.signal import savgol_filter

        window = max(5, 2 * round(_SMOOTHS_S / max(tracks.step_s, 1e-3) / 2) + 1)
        position, speed = tracks.place.copy(), tracks.speed_mps.copy()
        first = np.searchsorted(tracks.vehicle, np.arange(len(tracks.ids) + 1))
        for start, end in zip(first[:-1].tolist(), first[1:].tolist(), strict=True):
            if end - start < window:
                continue
            part, step = tracks.place[start:end], tracks.step_s
            position[start:end] = savgol_filter(part, window, 3, axis=0)
            velocity = np.asarray(savgol_filter(part, window, 3, deriv=1, delta=step, axis=0), float)
            speed[start:end] = np.hypot(velocity[:, 0], velocity[:, 1])
        slow = max(3 * self.noise_m / _SMOOTHS_S, 0.1)
        return replace(tracks, place=position, speed_mps=np.where(speed < slow, 0.0, speed))


def estimate_observation(placed: Placed) -> Observation:
    """Estimate the noise of positions from second differences of the lateral position on straight lanes."""
    tracks, left = placed.tracks, placed.left_m
    same = (tracks.vehicle[2:] == tracks.vehicle[:-2]) & (placed.code[2:] == placed.code[:-2])
    good = same & placed.free_lane[1:-1] & (tracks.speed_mps[1:-1] > _MOVES_MPS)
    if good.sum() < 200:
        return Observation()
    second = left[2:][good] - 2 * left[1:-1][good] + left[:-2][good]
    noise = 1.4826 * float(np.median(np.abs(second))) / np.sqrt(6)
    return Observation(noise if noise > _NOTICED_M else 0.0)

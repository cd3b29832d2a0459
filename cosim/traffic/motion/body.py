"""Bodies on springs: they dive under braking and lean in curves."""

from __future__ import annotations

import numpy as np

PITCH_PER_MPS2 = np.radians(0.35)
ROLL_PER_MPS2 = np.radians(0.45)
_LARGEST_RAD = np.radians(1.5)
_FREQUENCY_RADPS = 2 * np.pi * 1.3
_DAMPING = 0.45


class Springs:
    """The exact step of x'' + 2ζω·x' + ω²·(x − u) = 0 for an input u that is held over the step.

    Args:
        step_s: length of a step.
    """

    def __init__(self, step_s: float) -> None:
        a, damped = _DAMPING * _FREQUENCY_RADPS, _FREQUENCY_RADPS * np.sqrt(1 - _DAMPING**2)
        decay, c, s = np.exp(-a * step_s), np.cos(damped * step_s), np.sin(damped * step_s)
        self._matrix = decay * np.array(
            [[c + a / damped * s, s / damped], [-(_FREQUENCY_RADPS**2) / damped * s, c - a / damped * s]]
        )

    def step(self, state: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """One step.

        Args:
            state: (n, 2, 2) angle and rate of pitch, then of roll [rad, rad/s]; nose down and leaning to the right
                are positive.
            acceleration: (n, 2) along and to the left [m/s²].
        """
        rest = np.column_stack([-PITCH_PER_MPS2 * acceleration[:, 0], ROLL_PER_MPS2 * acceleration[:, 1]])
        rest = np.clip(rest, -_LARGEST_RAD, _LARGEST_RAD)
        away = state - np.stack([rest, np.zeros_like(rest)], 2)
        moved = away @ self._matrix.T
        moved[:, :, 0] += rest
        return moved

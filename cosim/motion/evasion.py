"""Other steps than the one a vehicle wants: slower ones, and, at walking pace, other turns of the wheels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosim.motion.stopping import BRAKES_MPS2, Stops, stops, travel

_EASES_MPS2 = (2.5, 5.0)
_CREEPS_BELOW_MPS = 1.0
_CREEPS_MPS = 0.5
_LOOKS_M = 0.5  # a creeping vehicle sees whether it could go on as far
_TURNS = (0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0, -1.0)  # of the largest curvature
_TRIES_S = 1.5  # standing so long it tries to get round what is in the way


@dataclass(frozen=True, eq=False)
class Rolling:
    """One vehicle's rear-axle bicycle: front bumper (2,) [m], heading [rad], curvature [1/m] and speed [m/s]."""

    front: np.ndarray
    heading: float
    curvature: float
    speed: float

    def roll(self, curvature_per_m: float, speed_mps: float, rear_m: float, step_s: float) -> Rolling:
        """A step at a speed with the wheels turned."""
        front, heading = travel(
            self.front,
            np.asarray(self.heading),
            np.asarray(curvature_per_m),
            np.asarray(speed_mps * step_s),
            np.asarray(rear_m),
        )
        return Rolling(front, float(heading), curvature_per_m, speed_mps)

    def stops(self, rear_m: float, length_m: float, step_s: float, speed_mps: float | None = None) -> Stops:
        """Boxes until it stands, braking from its speed or another."""
        speed = self.speed if speed_mps is None else speed_mps
        return stops(
            self.front[None],
            np.array([self.heading]),
            np.array([self.curvature]),
            np.array([speed]),
            np.array([rear_m]),
            np.array([length_m]),
            step_s,
        )


def evade(
    now: Rolling,
    wanted: Rolling,
    waits_s: float,
    build: tuple[float, float, float, float],
    step_s: float,
    clear: Callable[[Stops], bool],
) -> Rolling | None:
    """The first other step that is clear: eased, or round what is in the way.

    Args:
        now: before the step.
        wanted: after the step that is not clear.
        waits_s: for how long it could not go as it wants.
        build: rear axle behind the bumper, length [m], largest curvature [1/m], and how fast that changes [1/(m·s)].
        step_s: length of the step.
        clear: whether stops keep clear of everybody.
    """
    rear, length, largest, rate = build
    if now.speed > _CREEPS_BELOW_MPS:
        for ease in _EASES_MPS2:
            slower = min(wanted.speed, now.speed - ease * step_s)
            rolled = now.roll(wanted.curvature, max(slower, 0.0), rear, step_s)
            if clear(rolled.stops(rear, length, step_s)):
                return rolled
        return None
    if waits_s < _TRIES_S or wanted.speed <= 0.0:
        return None
    pace = min(_CREEPS_MPS, now.speed + 0.2)
    reach = rate * step_s if now.speed > 0.05 else np.inf  # wheels turn at rest
    for turn in sorted(_TURNS, key=lambda turn: abs(turn * largest - wanted.curvature)):
        curvature = float(np.clip(turn * largest, now.curvature - reach, now.curvature + reach))
        rolled = now.roll(curvature, pace, rear, step_s)
        far = rolled.stops(rear, length, step_s, float(np.sqrt(2 * BRAKES_MPS2 * _LOOKS_M)))
        if clear(rolled.stops(rear, length, step_s)) and clear(far):
            return rolled
    return None

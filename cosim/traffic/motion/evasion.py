"""Other steps than the one a vehicle wants: slower ones, and, at walking pace, other turns of the wheels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cosim.traffic.motion.stopping import BRAKES_MPS2, Stops, stops, travel

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


def evade(
    now: Rolling,
    wanted: Rolling,
    waits_s: float,
    build: tuple[float, float, float, float],
    step_s: float,
    clear: Callable[[Stops], np.ndarray],
) -> tuple[Rolling, Stops] | None:
    """The first other step that is clear, and the stops after it: eased, or round what is in the way.

    Args:
        now: before the step.
        wanted: after the step that is not clear.
        waits_s: for how long it could not go as it wants.
        build: rear axle behind the bumper, length [m], largest curvature [1/m], and how fast that changes [1/(m·s)].
        step_s: length of the step.
        clear: (k,) bool, stops that keep clear of all other bodies.
    """
    rear, length, largest, rate = build
    looks = None
    if now.speed > _CREEPS_BELOW_MPS:
        curvature = np.full(len(_EASES_MPS2), wanted.curvature)
        speed = np.array([max(min(wanted.speed, now.speed - ease * step_s), 0.0) for ease in _EASES_MPS2])
    elif waits_s < _TRIES_S or wanted.speed <= 0.0:
        return None
    else:
        reach = rate * step_s if now.speed > 0.05 else np.inf  # wheels turn at rest
        turns = np.array(sorted(_TURNS, key=lambda turn: abs(turn * largest - wanted.curvature))) * largest
        curvature = np.clip(turns, now.curvature - reach, now.curvature + reach)
        speed = np.full(len(turns), min(_CREEPS_MPS, now.speed + 0.2))
        looks = np.full(len(turns), np.sqrt(2 * BRAKES_MPS2 * _LOOKS_M))
    k = len(speed)
    front, heading = travel(
        np.tile(now.front, (k, 1)), np.full(k, now.heading), curvature, speed * step_s, np.full(k, rear)
    )
    after = stops(front, heading, curvature, speed, np.full(k, rear), np.full(k, length), step_s)
    free = clear(after)
    if looks is not None and free.any():
        free &= clear(stops(front, heading, curvature, looks, np.full(k, rear), np.full(k, length), step_s))
    if not free.any():
        return None
    i = int(np.argmax(free))
    rolled = Rolling(front[i], float(heading[i]), float(curvature[i]), float(speed[i]))
    return rolled, after.take(np.array([i]))

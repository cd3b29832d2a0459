"""Positions at which bodies stop if their drivers brake now."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.traffic.headings import unit_vectors

BRAKES_MPS2 = 8.0  # on a dry road
_STANDS_MPS = 1e-3


@dataclass(frozen=True, eq=False)
class Stops:
    """Boxes of n vehicles from some instant until they have stopped, one pose per step.

    Attributes:
        centre: (n, k, 2) world metres.
        heading_rad: (n, k).
        last: (n,) index of the first pose at which a vehicle has stopped.
    """

    centre: np.ndarray
    heading_rad: np.ndarray
    last: np.ndarray

    def put(self, row: int, other: Stops, other_row: int) -> None:
        """Replace a vehicle's poses with another set's, which may hold fewer or as many of them."""
        steps = np.minimum(np.arange(self.centre.shape[1]), other.centre.shape[1] - 1)
        self.centre[row], self.heading_rad[row] = other.centre[other_row, steps], other.heading_rad[other_row, steps]
        self.last[row] = other.last[other_row]

    def take(self, rows: np.ndarray) -> Stops:
        """Those of some rows."""
        return Stops(self.centre[rows], self.heading_rad[rows], self.last[rows])

    @classmethod
    def standing(cls, centre: np.ndarray, heading_rad: np.ndarray, steps: int) -> Stops:
        """n stationary vehicles at positions (n, 2) with headings (n,)."""
        return cls(
            np.repeat(centre[:, None], steps, axis=1),
            np.repeat(heading_rad[:, None], steps, axis=1),
            np.zeros(len(centre), int),
        )


def steps_to_rest(speed_mps: np.ndarray, step_s: float) -> np.ndarray:
    """(n,) steps until each braking vehicle has stopped."""
    speed = np.abs(speed_mps)
    return np.where(speed > _STANDS_MPS, np.ceil(speed / BRAKES_MPS2 / step_s - 1e-9), 0).astype(int)


def travel(
    front: np.ndarray, heading_rad: np.ndarray, curvature_per_m: np.ndarray, way_m: np.ndarray, rear_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Front bumpers (…, 2) and headings (…) after ways of the rear axles along arcs; shapes broadcast to `way_m`."""
    turned = curvature_per_m * way_m
    chord = way_m * np.sinc(turned / (2 * np.pi))
    middle, after = heading_rad + turned / 2, heading_rad + turned
    moved = np.empty((*after.shape, 2))
    moved[..., 0] = front[..., 0] + chord * np.cos(middle) + rear_m * (np.cos(after) - np.cos(heading_rad))
    moved[..., 1] = front[..., 1] + chord * np.sin(middle) + rear_m * (np.sin(after) - np.sin(heading_rad))
    return moved, after


def braked(state: dict[str, np.ndarray], rear_m: np.ndarray, step_s: float) -> dict[str, np.ndarray]:
    """The state of n vehicles after a step of the hardest braking with the wheels held as they are.

    Args:
        state: `front` (n, 2), `heading`, `curvature` and `speed` (n,).
        rear_m: (n,) rear axles behind the bumpers.
        step_s: length of the step.
    """
    speed = np.abs(state["speed"])
    until = np.minimum(step_s, speed / BRAKES_MPS2)
    way = np.sign(state["speed"]) * (speed * until - 0.5 * BRAKES_MPS2 * until**2)
    front, heading = travel(state["front"], state["heading"], state["curvature"], way, rear_m)
    slower = np.sign(state["speed"]) * np.maximum(speed - BRAKES_MPS2 * step_s, 0.0)
    return {"front": front, "heading": heading, "curvature": state["curvature"], "speed": slower}


def stops(
    front: np.ndarray,
    heading: np.ndarray,
    curvature: np.ndarray,
    speed: np.ndarray,
    rear_m: np.ndarray,
    length_m: np.ndarray,
    step_s: float,
    poses: int = 1,
) -> Stops:
    """Vehicles (all arguments n long, as in `braked`) brake as hard as they can with the wheels held as they are.

    Args:
        poses: how many a vehicle has at least.
    """
    last = steps_to_rest(speed, step_s)
    time = step_s * np.arange(max(int(last.max(initial=0)) + 1, poses))
    centre, turned = np.empty((len(front), len(time), 2)), np.empty((len(front), len(time)))
    centre[:] = (front - length_m[:, None] / 2 * unit_vectors(heading))[:, None]
    turned[:] = heading[:, None]
    rolls = np.flatnonzero(last)
    fast = np.abs(speed[rolls])[:, None]
    until = np.minimum(time, fast / BRAKES_MPS2)
    way = np.sign(speed[rolls])[:, None] * (fast * until - 0.5 * BRAKES_MPS2 * until**2)
    tip, turned[rolls] = travel(
        front[rolls, None], heading[rolls, None], curvature[rolls, None], way, rear_m[rolls, None]
    )
    centre[rolls] = tip - length_m[rolls, None, None] / 2 * unit_vectors(turned[rolls])
    return Stops(centre, turned, last)

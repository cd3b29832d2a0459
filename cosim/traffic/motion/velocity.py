"""Velocities of boxes from their poses before and after a step."""

from __future__ import annotations

import numpy as np

from cosim.traffic.headings import unit_vectors


def velocities(
    before: tuple[np.ndarray, np.ndarray], after: tuple[np.ndarray, np.ndarray], half_m: np.ndarray, step_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Speed of the centres along and across the heading after the step [m/s], and yaw rate [rad/s]; (n,) each.

    Args:
        before, after: front bumpers (n, 2) and headings (n,).
        half_m: (n,) half lengths.
        step_s: time between.
    """
    (front_0, heading_0), (front, heading) = before, after
    forward = unit_vectors(heading)
    was = unit_vectors(heading_0)
    velocity = (front - front_0 - half_m[:, None] * (forward - was)) / step_s
    along = velocity[:, 0] * forward[:, 0] + velocity[:, 1] * forward[:, 1]
    across = velocity[:, 1] * forward[:, 0] - velocity[:, 0] * forward[:, 1]
    turned = (heading - heading_0 + np.pi) % (2 * np.pi) - np.pi
    return along, across, turned / step_s

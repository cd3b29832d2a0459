"""Beams that a smooth surface reflects specularly."""

from __future__ import annotations

import numpy as np

from sensors.normals import decode_normals
from sensors.returns import Returns
from sensors.shot import Shot

_OFF_SURFACE_M = 2e-3


def mirrored_returns(mirrors: Returns, shot: Shot, leg_m: float) -> tuple[Returns, np.ndarray]:
    """Returns that beams see mirrored in the surfaces they hit.

    Args:
        mirrors: returns of the mirroring surfaces, at most one a beam.
        shot: of the revolution; needs its world.
        leg_m: farthest distance after the mirror.

    Returns:
        Returns at the folded range, with the reflectance of the surface there as intensity, and which (m,) of the
        mirrors gave one.
    """
    if shot.world is None:
        raise ValueError("a mirrored beam is a new ray; measure with trace_and_measure")
    direction, normal = shot.direction_in_world(mirrors), decode_normals(mirrors.normal_code)
    onward = direction - 2 * np.einsum("ij,ij->i", direction, normal)[:, None] * normal
    start = shot.points_in_world(mirrors) + onward * np.float64(_OFF_SURFACE_M)
    surface = shot.world.shoot(start, onward, shot.time_s(mirrors), leg_m)
    folded = mirrors.range_m + surface.range_m + np.float32(_OFF_SURFACE_M)
    seen = surface.exists & (folded <= shot.pattern.range_m[1])
    rows = np.flatnonzero(seen)
    met = surface.take(rows)
    intensity = shot.hits.reflectance(met)
    return Returns.spurious(mirrors.beam[rows], folded[rows], intensity, met.material), seen


def normal_density(apart_m: np.ndarray, sigma_m: float) -> np.ndarray:
    """Density [1/m] of a normal deviate; 0 infinitely far away."""
    return np.exp(-0.5 * (apart_m / sigma_m) ** 2) / (sigma_m * np.sqrt(2 * np.pi))

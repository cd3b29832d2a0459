"""Find the reason why no point of a scan is trusted: order of the points, beam pattern, mount height or surroundings.

Ground is trusted between neighbouring rings with continuous heights. This requires that each ring is one laser, that
the ground is below the sensor, and that the gaps between rings on the ground are small: for lasers with an elevation
difference Δ at height h, the gap at distance r is about Δ·r²/h.
"""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti import Frame
from cosim.labelled_twin.trusted_ground import widest_gap_m
from sensors.pattern import Pattern

_MIN_POINTS = 30  # for the elevation of a ring
_RING_SPREAD_DEG = (
    1.5  # maximum interquartile range of a ring's elevations; two optical centres cause half of it at 5 m
)
_MAX_ELEVATION_ERROR_DEG = 1.0  # between a ring and its laser in the pattern
_NEAR_M = (3.0, 14.0)
_GROUND_BELOW_M = (0.3, 6.0)


def why_untrusted(frame: Frame, pattern: Pattern) -> str:
    """Most likely reason with the evidence and the remedy, as the end of a sentence.

    Args:
        frame: frame of which no point is trusted.
        pattern: beam pattern with which the twin was made.

    Raises:
        FormatError: points or rays cannot be read.
    """
    points, ring = frame.points[:, :3].astype(np.float64), frame.rays.ring
    elevation_deg = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    rings = [
        number for number in range(int(ring.max(initial=0)) + 1) if np.count_nonzero(ring == number) >= _MIN_POINTS
    ]
    quartiles = np.array([np.quantile(elevation_deg[ring == number], (0.25, 0.5, 0.75)) for number in rings])
    return (
        _check_order(quartiles, frame.rays.recovered)
        or _check_pattern(np.array(rings, int), quartiles, pattern)
        or _check_mount(points, pattern)
        or "there is no even ground around the sensor, and no labelled object has a point; choose other frames"
    )


def _check_order(quartiles: np.ndarray, recovered: bool) -> str:
    if not len(quartiles):
        return f"order of points: no ring has {_MIN_POINTS} points; store scans ring by ring, or give rays/NAME.npz"
    spread = float(np.median(quartiles[:, 2] - quartiles[:, 0]))
    if spread <= _RING_SPREAD_DEG:
        return ""
    remedy = "store scans ring by ring, top ring first, or give rays/NAME.npz" if recovered else "correct rays/NAME.npz"
    return f"order of points: a ring spans {spread:.1f}° of elevation, but a laser has one elevation; {remedy}"


def _check_pattern(rings: np.ndarray, quartiles: np.ndarray, pattern: Pattern) -> str:
    known = rings < pattern.rings
    expected = np.array(pattern.elevation_deg)[rings[known]]
    error_deg = float(np.median(np.abs(quartiles[known, 1] - expected))) if known.any() else np.inf
    if known.all() and error_deg <= _MAX_ELEVATION_ERROR_DEG:
        return ""
    problem = (
        f"its elevations differ by {error_deg:.1f}° from the scan" if known.all() else f"it has {pattern.rings} rings"
    )
    return (
        f"pattern {pattern.name}: {problem}; the scan has {len(rings)} rings from {quartiles[0, 1]:.1f}° to "
        f"{quartiles[-1, 1]:.1f}°; give the sensor's pattern with --pattern"
    )


def _check_mount(points: np.ndarray, pattern: Pattern) -> str:
    reach = np.hypot(points[:, 0], points[:, 1])
    near = points[(reach > _NEAR_M[0]) & (reach < _NEAR_M[1]), 2]
    counts, edges = np.histogram(near, np.arange(-20.0, 20.0, 0.1))
    modal_m = edges[counts.argmax()] + 0.05
    below_m = -float(np.median(near[np.abs(near - modal_m) < 0.1])) if counts.any() else 0.0
    if not _GROUND_BELOW_M[0] < below_m < _GROUND_BELOW_M[1]:
        where = f"{_NEAR_M[0]:g}–{_NEAR_M[1]:g} m away"
        observed = (
            f"most points {where} are {-below_m:+.1f} m from the sensor's height"
            if len(near)
            else f"no point is {where}"
        )
        return (
            f"height of mount: {observed}, but the ground must be {_GROUND_BELOW_M[0]:g}–{_GROUND_BELOW_M[1]:g} m "
            "below it; points are x forward, y left, z up, in metres"
        )
    below_deg = -np.array(pattern.elevation_deg)
    ring_reach_m = below_m / np.tan(np.radians(np.sort(below_deg[below_deg > 0])[::-1]))  # nearest first
    visible_m = ring_reach_m[ring_reach_m > _NEAR_M[0]]
    gaps_m = np.diff(visible_m)
    if len(gaps_m) and (gaps_m < widest_gap_m(visible_m[1:])).any():
        return ""
    gap = (
        f"are {gaps_m[0]:.1f} m apart on the ground at {visible_m[1]:.0f} m, the limit is "
        f"{widest_gap_m(visible_m[1:2])[0]:.1f} m"
        if len(gaps_m)
        else "hit the ground at one distance at most"
    )
    return (
        f"height of mount: {below_m:.1f} m above ground, rings of {pattern.name} {gap}; "
        "use a sensor with closer rings or a higher mount, or label objects"
    )

"""Why nothing of a scan could be trusted: the order of its points, the pattern, the height of the mount, or the place.

Ground is trusted between neighbouring rings that meet it evenly. That asks for rings that are one laser each, for
ground below the sensor, and for rings that lie close together on it: with lasers Δ apart in elevation at height h,
neighbouring rings at distance r lie about Δ·r²/h apart.
"""

from __future__ import annotations

import numpy as np

from cosim.drives.kitti import Frame
from cosim.labelled_twin.trusted_ground import widest_gap_m
from sensors.pattern import Pattern

_FEWEST = 30  # points of a ring whose elevation means something
_RING_SPREAD_DEG = 1.5  # of one ring's elevations, 25 % to 75 %; two optical centres make half of that at 5 m
_ELEVATION_OFF_DEG = 1.0  # between a ring and its laser in the pattern
_NEAR_M = (3.0, 14.0)
_GROUND_BELOW_M = (0.3, 6.0)


def why_untrusted(frame: Frame, pattern: Pattern) -> str:
    """The likeliest reason, with the values that speak for it and what to do, for the end of a sentence.

    Args:
        frame: with points; none of them is trusted.
        pattern: the twin was made with.

    Raises:
        FormatError: points or rays cannot be read.
    """
    points, ring = frame.points[:, :3].astype(np.float64), frame.rays.ring
    elevation_deg = np.degrees(np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])))
    rings = [number for number in range(int(ring.max(initial=0)) + 1) if np.count_nonzero(ring == number) >= _FEWEST]
    quartiles = np.array([np.quantile(elevation_deg[ring == number], (0.25, 0.5, 0.75)) for number in rings])
    return (
        _order(quartiles, frame.rays.recovered)
        or _pattern(np.array(rings, int), quartiles, pattern)
        or _mount(points, pattern)
        or "no even ground surrounds the sensor, and no labelled object has a point; choose other frames"
    )


def _order(quartiles: np.ndarray, recovered: bool) -> str:
    if not len(quartiles):
        return f"order of points: no ring has {_FEWEST} points; store scans ring by ring, or give rays/NAME.npz"
    spread = float(np.median(quartiles[:, 2] - quartiles[:, 0]))
    if spread <= _RING_SPREAD_DEG:
        return ""
    remedy = "store scans ring by ring, top ring first, or give rays/NAME.npz" if recovered else "mend rays/NAME.npz"
    return f"order of points: a ring spans {spread:.1f}° of elevation where a laser has one; {remedy}"


def _pattern(rings: np.ndarray, quartiles: np.ndarray, pattern: Pattern) -> str:
    known = rings < pattern.rings
    expected = np.array(pattern.elevation_deg)[rings[known]]
    off = float(np.median(np.abs(quartiles[known, 1] - expected))) if known.any() else np.inf
    if known.all() and off <= _ELEVATION_OFF_DEG:
        return ""
    what = f"its rings look {off:.1f}° away from the scan's" if known.all() else f"it has {pattern.rings} rings"
    return (
        f"pattern {pattern.name}: {what}, {len(rings)} rings from {quartiles[0, 1]:.1f}° to {quartiles[-1, 1]:.1f}°; "
        "give the sensor's own with --pattern"
    )


def _mount(points: np.ndarray, pattern: Pattern) -> str:
    reach = np.hypot(points[:, 0], points[:, 1])
    near = points[(reach > _NEAR_M[0]) & (reach < _NEAR_M[1]), 2]
    counts, edges = np.histogram(near, np.arange(-20.0, 20.0, 0.1))
    commonest = edges[counts.argmax()] + 0.05
    below_m = -float(np.median(near[np.abs(near - commonest) < 0.1])) if counts.any() else 0.0
    if not _GROUND_BELOW_M[0] < below_m < _GROUND_BELOW_M[1]:
        at = f"{_NEAR_M[0]:g}–{_NEAR_M[1]:g} m away"
        seen = (
            f"most points {at} lie {-below_m:+.1f} m from the sensor's height" if len(near) else f"no point lies {at}"
        )
        return (
            f"height of mount: {seen}, and ground is looked for {_GROUND_BELOW_M[0]:g}–{_GROUND_BELOW_M[1]:g} m below "
            "it; points are x forward, y left, z up, in metres"
        )
    below_deg = -np.array(pattern.elevation_deg)
    meets_m = below_m / np.tan(np.radians(np.sort(below_deg[below_deg > 0])[::-1]))  # nearest first
    seen_m = meets_m[meets_m > _NEAR_M[0]]
    gaps_m = np.diff(seen_m)
    if len(gaps_m) and (gaps_m < widest_gap_m(seen_m[1:])).any():
        return ""
    where = f"{gaps_m[0]:.1f} m apart at {seen_m[1]:.0f} m" if len(gaps_m) else "in one place at most"
    bridged = f" where {widest_gap_m(seen_m[1:2])[0]:.1f} m are bridged" if len(gaps_m) else ""
    return (
        f"height of mount: {below_m:.1f} m above ground, rings of {pattern.name} meet it {where}{bridged}; "
        "take a sensor with closer rings or a higher mount, or label objects"
    )

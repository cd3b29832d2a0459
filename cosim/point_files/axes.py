"""Check from the points that coordinates are metres in a right-handed frame with z up.

Two independent clues fix the frame of a spinning sensor: the ground lies below it, and its head turns clockwise seen
from above (Velodyne, Hesai, Ouster and RoboSense do so unless they are configured otherwise).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.point_files.clues import elevation_entropy, find_ground, range_resolution_unit, sense_of_rotation
from cosim.point_files.scan import PointFileError

_UNITS_M = {0.01: "cm", 0.001: "mm"}
_FOOT_M = 0.3048
_CAR_HEIGHTS_M = (1.3, 2.6)  # of sensors on cars and vans above the ground
_FAR_METRES, _NEAR_FEET = 300.0, 100.0  # units: no sensor sees farther in metres; too near for outdoor scans in feet
_RANGES_M = (1.0, 150.0)  # median ranges of scans of any spinning sensor
_FULL_CIRCLE = 0.5  # share of sectors with points of a scan that is about the sensor
_SECTORS = 36
_ALL_AROUND, _LAYER_M = 0.8, 0.2  # share of sectors in which the ground is seen, half the thickness of its layer
_FEWEST = 200


def find_metres(clouds: Sequence[np.ndarray], source: str, notes: list[str]) -> float:
    """Length of one unit of x, y, z [m]: metres unless both the ranges and the ground's depth say otherwise.

    Ranges in feet are possible in metres, too. Where the ground is as deep below the sensor as in a car if coordinates
    are feet, and as below a mast if they are metres, the farthest points and the resolution of the ranges decide.

    Raises:
        PointFileError: ranges are no metres, and no other unit agrees with both clues; or feet and metres are possible.
    """
    xyz = np.concatenate(clouds) if clouds else np.zeros((0, 3))
    if len(xyz) < _FEWEST:
        return 1.0
    median = float(np.median(np.linalg.norm(xyz, axis=1)))
    if median <= _RANGES_M[1] or not _surrounds(xyz):
        return _metres_or_feet(
            xyz, source, notes
        )  # small scenes are possible; coordinates far from the origin are not measured from the sensor
    fitting = [
        unit for unit in _UNITS_M if _RANGES_M[0] < median * unit < _RANGES_M[1] and find_ground(xyz, unit) is not None
    ]
    if len(fitting) == 1:
        ground = find_ground(xyz, fitting[0])
        depth = abs(ground.z * fitting[0]) if ground else 0.0
        notes.append(
            f"coordinates are in {_UNITS_M[fitting[0]]}: the median range is {median * fitting[0]:.1f} m and the "
            f"ground {depth:.1f} m below"
        )
        return fitting[0]
    raise PointFileError(
        f"{source}: the median range is {median:.4g}; in metres no scan reaches so far, and the ground is not seen at "
        "a plausible depth in cm or mm; state the unit with --metres, as 0.001"
    )


def check_axes(clouds: Sequence[np.ndarray], times: Sequence[np.ndarray | None], metres: float, source: str) -> bool:
    """Raise where ground and sense of rotation contradict a right-handed frame with z up.

    Returns whether both clues are there and confirm it.

    Args:
        clouds: (n, 3) points of some scans, in the order of the files.
        times: (n,) firing times of each, or None.
        metres: length of one unit.
        source: name of folder or file, for messages.

    Raises:
        PointFileError: z points down, another axis than z is vertical, or y points to the right.
    """
    _demand_vertical(clouds, metres, source)
    grounds = [found for cloud in clouds if (found := find_ground(cloud, metres)) is not None]
    if not grounds:
        return False
    z = float(np.median([ground.z for ground in grounds])) * metres
    share = float(np.median([ground.share for ground in grounds]))
    if z > 0:
        raise PointFileError(
            f"{source}: {share:.0%} of the near points lie in a layer {z:.1f} m above the sensor and none beyond, so "
            "the z axis points down to the ground; state the axes: --axes x,-y,-z (x forward, y right, z down), or "
            "--axes x,y,-z where only z is mirrored, or --axes x,y,z where this is right"
        )
    senses = [sense_of_rotation(cloud, time) for cloud, time in zip(clouds, times, strict=True)]
    known = [sense for sense in senses if sense is not None]
    if known and 2 * sum(sense > 0 for sense in known) > len(known):
        raise PointFileError(
            f"{source}: the ground is {abs(z):.1f} m below, so z points up, but azimuths increase in firing order: "
            "either y points to the right (a left-handed frame, the scan is mirrored), or the head turns "
            "counter-clockwise seen from above, which spinning sensors do not by default; settle it with --flip-y (y "
            "is mirrored; `flip_y: true` in drive.yaml or recording.yaml) or --axes x,y,z (it is right)"
        )
    return bool(known)


def _demand_vertical(clouds: Sequence[np.ndarray], metres: float, source: str) -> None:
    """Raise where ground and lasers show that another axis than z is vertical.

    The ground is a layer all around across that axis, and none across z; and elevations about that axis are as few as
    about z, or fewer, as of the cones that lasers draw about the axis of the head. A wall close by is such a layer,
    too, but lasers draw no cones about its normal.
    """
    across_z = [find_ground(cloud, metres) for cloud in clouds]
    around_z = [
        ground is not None and _lies_around(cloud, ground.z, metres)
        for cloud, ground in zip(clouds, across_z, strict=True)
    ]
    if 2 * sum(around_z) > len(clouds):
        return
    for letter, order in (("y", [0, 2, 1]), ("x", [1, 2, 0])):
        turned = [find_ground(cloud[:, order], metres) for cloud in clouds]
        clear = [
            ground
            for cloud, ground in zip(clouds, turned, strict=True)
            if ground is not None and _lies_around(cloud[:, order], ground.z, metres)
        ]
        is_axis = [elevation_entropy(cloud[:, order]) <= elevation_entropy(cloud) for cloud in clouds]
        if clear and 2 * len(clear) > len(clouds) and 2 * sum(is_axis) > len(clouds):
            depth = float(np.median([ground.z for ground in clear])) * metres
            down = letter if depth > 0 else f"-{letter}"
            raise PointFileError(
                f"{source}: no ground lies all around across z, but {clear[0].share:.0%} of the near points lie in a "
                f"layer at {letter} = {depth:.1f} m, so {down} points down, as in a camera's axes; state which axes "
                "are forward, left and up, as --axes z,-x,-y, or --axes x,y,z where this is right"
            )


def _lies_around(xyz: np.ndarray, z: float, metres: float) -> bool:
    """Whether a layer lies all around the axis it is across, as the ground does and a wall does not."""
    layer = xyz[np.abs(xyz[:, 2] - z) * metres < _LAYER_M]
    counts, _ = np.histogram(np.arctan2(layer[:, 1], layer[:, 0]), _SECTORS, (-np.pi, np.pi))
    return float(np.mean(counts > 0)) > _ALL_AROUND


def _metres_or_feet(xyz: np.ndarray, source: str, notes: list[str]) -> float:
    """Length of one unit [m], where only metres and feet are possible.

    Raises:
        PointFileError: the ground is at a depth that is usual in both, and no other clue decides.
    """
    ground = find_ground(xyz, _FOOT_M)
    depth = 0.0 if ground is None else abs(ground.z)
    if not _CAR_HEIGHTS_M[0] < depth * _FOOT_M < _CAR_HEIGHTS_M[1]:
        return 1.0
    ranges = np.linalg.norm(xyz, axis=1)
    far, resolution = float(np.quantile(ranges, 0.999)), range_resolution_unit(ranges, (1.0, _FOOT_M))
    readings = (
        f"the ground is {depth:.1f} units below the sensor ({depth * _FOOT_M:.1f} m if they are feet, as on a car; "
        f"{depth:.1f} m if they are metres, as on a mast), and the farthest points are {far:.0f} units away"
    )
    clues = {1.0: [resolution == 1.0, far < _NEAR_FEET], _FOOT_M: [resolution == _FOOT_M, far > _FAR_METRES]}
    is_metres, is_feet = (any(found) for found in clues.values())
    if is_metres == is_feet:
        raise PointFileError(
            f"{source}: coordinates may be feet or metres: {readings}; state the unit: --metres {_FOOT_M} for feet, or "
            "--metres 1 (`metres:` in drive.yaml or recording.yaml)"
        )
    reason = "ranges are multiples of a few millimetres then" if resolution else "farther than a sensor sees in metres"
    if is_feet:
        notes.append(f"coordinates are feet: {readings}: {reason}; --metres 1 otherwise")
        return _FOOT_M
    reason = "ranges are multiples of a few millimetres then" if resolution else "too near for a sensor in feet"
    notes.append(f"coordinates are metres: {readings}: {reason}; --metres {_FOOT_M} if they are feet")
    return 1.0


def _surrounds(xyz: np.ndarray) -> bool:
    """Whether points lie around the origin, not to one side of it."""
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    counts, _ = np.histogram(azimuth, _SECTORS, (-np.pi, np.pi))
    return float(np.mean(counts > 0)) > _FULL_CIRCLE

"""Refuses drives that cannot be compared, and says why before anything is called a missing effect."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.data.observation import Observed
from cosim.drives.kitti import Drive
from cosim.errors import DriveError

_AGREES_M, _AGREES_UNSAID_M = 0.5, 3.0
_FEWEST_SHARE = 0.35
_UPRIGHT, _NEAR_M, _FEWEST_UPRIGHT, _FEWEST_STANDING = 0.5, 1.0, 300, 0.5
_BRIGHTEST, _MOST_BEAMS = 1.001, 0.99


def opened(drive: Drive | str | Path) -> Drive:
    """A drive that has what a comparison needs.

    Raises:
        DriveError: no points, or no twin.
    """
    drive = drive if isinstance(drive, Drive) else Drive(drive)
    first = drive[drive.frames[0]]
    if not first.has("twin/frames"):
        raise DriveError(
            f"{drive.root}: no twin/frames/{first.name}.json, so that beams cannot be traced; "
            "write a twin, or make one from labels with `cosim twin`"
        )
    if not any(len(drive[name].points) for name in drive.frames[:3]):
        raise DriveError(f"{drive.root}: the first scans hold no points; give a drive with measurements")
    return drive


def check_fit(frame: TracedFrame, drive: Drive) -> None:
    """Refuse a twin that is not that of the drive.

    Raises:
        DriveError: too few points lie where the twin says; the measured misfit is told.
    """
    solid, observed = frame.shot.hits.solid, frame.observed
    _check_brightness(observed, drive)
    usable = observed.returned & observed.trusted
    if not usable.any():
        raise DriveError(
            f"{drive.root}: no point of frame {frame.name} fits a beam of the sensor's pattern; name its own"
        )
    residual = observed.range_from(frame.shot.rays.origin) - solid.range_m
    gap = np.abs(np.nan_to_num(residual[usable], nan=1e3, posinf=1e3, neginf=1e3))
    # Without rays/ the model's lasers may look elsewhere than the unit's, and that is for the diagnosis to say.
    agrees_m = _AGREES_UNSAID_M if observed.recovered else _AGREES_M
    share = float((gap < agrees_m).mean())
    if share < _FEWEST_SHARE:
        raise DriveError(
            f"{drive.root}: the twin does not fit frame {frame.name}: only {share:.0%} of points lie within "
            f"{agrees_m} m of it, the median is {np.median(gap):.2f} m off; check frames, axes and the LiDAR's pose"
        )
    # Flat ground is alike everywhere: only what stands on it tells one place from another.
    upright = usable & solid.exists & (np.abs(solid.normal[:, 2]) < _UPRIGHT)
    standing = np.abs(residual[upright])
    share = float((standing < _NEAR_M).mean()) if upright.sum() >= _FEWEST_UPRIGHT else 1.0
    if not observed.recovered and share < _FEWEST_STANDING:
        raise DriveError(
            f"{drive.root}: the twin does not fit frame {frame.name}: only {share:.0%} of points on what stands "
            f"upright in it lie within {_NEAR_M:g} m, the median is {np.median(standing):.2f} m off; "
            "check which frame is which"
        )


def _check_brightness(observed: Observed, drive: Drive) -> None:
    intensity = observed.intensity[np.isfinite(observed.intensity)]
    bright = float(np.quantile(intensity, _MOST_BEAMS)) if len(intensity) else 0.0
    if bright > _BRIGHTEST:
        raise DriveError(
            f"{drive.root}: intensities reach {intensity.max():g}, and are 0–1 in velodyne/; "
            "divide them, by 255 if they are bytes"
        )

"""Refuses drives that cannot be compared, and says why before anything is called a missing effect."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.drives.kitti import Drive
from cosim.errors import DriveError


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
    solid, observed, settings = frame.shot.hits.solid, frame.observed, frame.settings.beams
    usable = observed.returned & observed.trusted
    if not usable.any():
        raise DriveError(
            f"{drive.root}: no point of frame {frame.name} fits a beam of the sensor's pattern and lies where the twin "
            "may be compared; name the sensor's own pattern, or record while the sensor moves"
        )
    residual = observed.range_from(frame.shot.rays.origin) - solid.range_m
    gap = np.abs(np.nan_to_num(residual[usable], nan=1e3, posinf=1e3, neginf=1e3))
    # Without rays/ the model's lasers may look elsewhere than the unit's, and that is for the diagnosis to say.
    agrees_m = settings.agrees_unsaid_m if observed.recovered else settings.agrees_m
    share = float((gap < agrees_m).mean())
    if share < settings.fewest_share:
        raise DriveError(
            f"{drive.root}: the twin does not fit frame {frame.name}: only {share:.0%} of points lie within "
            f"{agrees_m} m of it, the median is {np.median(gap):.2f} m off; check frames, axes and the LiDAR's pose"
        )
    # Flat ground is alike everywhere: only what stands on it tells one place from another.
    upright = usable & solid.exists & (np.abs(solid.normal[:, 2]) < settings.upright)
    standing = np.abs(residual[upright])
    share = float((standing < settings.same_m).mean()) if upright.sum() >= settings.fewest_upright else 1.0
    if not observed.recovered and share < settings.fewest_standing:
        raise DriveError(
            f"{drive.root}: the twin does not fit frame {frame.name}: only {share:.0%} of points on what stands "
            f"upright in it lie within {settings.same_m:g} m, the median is {np.median(standing):.2f} m off; "
            "check which frame is which"
        )

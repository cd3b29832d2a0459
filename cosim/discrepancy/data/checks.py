"""Refuses drives that cannot be compared, saying why; and notes on what a drive does not let one know."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.data.observation import intensity_unit
from cosim.discrepancy.settings import DEFAULT, Beams
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


_OF_OWN_MAP = ("mount_rotation", "mount_translation", "suspension_pitch", "time_offset", "range_scale")
_OF_WHAT_IS_IN_NO_MAP = ("backscatter", "false_alarms", "mirror_ghost", "blooming")
_OF_POSES = ("mount_rotation", "mount_translation", "suspension_pitch")
_NO_MATTER = ("image_", "depth_", "semantic_", "instance_", "label_2", "oxts", "hits")


def drive_notes(drive: Drive, *, frames: int, bad: int, strays: int, has_intensity: bool) -> tuple[str, ...]:
    """Of a drive that is compared with its twin.

    Args:
        drive: with its twin.
        frames: how many of them are compared.
        bad, strays: points of these with NaN or infinity, and those that fit no beam.
        has_intensity: whether points have any.
    """
    said = [note for note in drive.missing if not note.startswith(_NO_MATTER)]
    if drive.materials_path is None:
        said.append("twin/materials.yaml is absent: reflectances are taken from colours, so intensities mean little")
    if bad:
        said.append(f"{bad} points with NaN or infinity were left out")
    if strays:
        said.append(f"{strays} points fit no beam of the sensor's pattern and were left out")
    if (unit := intensity_unit(drive)) != 1:
        said.append(f"intensities are bytes: they were divided by {unit:g}")
    if not has_intensity:
        said.append("there are no intensities: that channel is left out")
    if frames == 1:
        said.append("one frame only: what differs from frame to frame cannot be told from what is constant")
    return tuple(said)


def undetermined_effects(fitted: int, of_own_map: bool, settings: Beams = DEFAULT.beams) -> tuple[str, ...]:
    """Effects that so many scans cannot tell from errors of their poses, or a map made of them from its own."""
    return (
        *(_OF_POSES if fitted < settings.fewest_scans else ()),
        *((*_OF_OWN_MAP, *_OF_WHAT_IS_IN_NO_MAP) if of_own_map else ()),
    )


def fit_notes(fitted: int, is_held_out: bool, of_own_map: bool, settings: Beams = DEFAULT.beams) -> tuple[str, ...]:
    """Of how many frames were fitted, whether others judged, and whether the twin is a map made of them."""
    said = []
    if of_own_map:
        said.append(
            "the twin is a map made of the scans: places and reflectances of surfaces and poses of scans are free, so "
            f"{', '.join(_OF_OWN_MAP)} and a constant offset along all normals are not told by this drive"
        )
        said.append(
            "returns from what the map does not hold are left out, be it traffic, leaves or fog: "
            f"{', '.join(_OF_WHAT_IS_IN_NO_MAP)} are not told by this drive"
        )
    if fitted < settings.fewest_scans:
        count = "one frame is" if fitted == 1 else f"{fitted} frames are"
        said.append(
            f"{count} too few to tell a sensor that is off as a whole from poses that are: "
            f"{', '.join(_OF_POSES[:-1])} and {_OF_POSES[-1]} do not show"
        )
    if not is_held_out:
        said.append("no frame was left to judge by: errors after a fit are flattering")
    return tuple(said)

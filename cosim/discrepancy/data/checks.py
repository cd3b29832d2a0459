"""Checks whether a drive can be compared with its twin, and notes on the limits of what it can show."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.data.observation import intensity_unit
from cosim.discrepancy.settings import DEFAULT, BeamSampling
from cosim.drives.kitti import Drive
from cosim.errors import DriveError


def opened(drive: Drive | str | Path) -> Drive:
    """Open a drive and check that it has points and a twin.

    Raises:
        DriveError: there are no points, or there is no twin.
    """
    drive = drive if isinstance(drive, Drive) else Drive(drive)
    first = drive[drive.frames[0]]
    if not first.has("twin/frames"):
        raise DriveError(
            f"{drive.root}: no twin/frames/{first.name}.json, which is needed to trace beams; "
            "write a twin, or make one from labels with `cosim twin`"
        )
    if not any(len(drive[name].points) for name in drive.frames[:3]):
        raise DriveError(f"{drive.root}: the first scans contain no points; pass a drive with measurements")
    return drive


def check_fit(frame: TracedFrame, drive: Drive) -> None:
    """Check that the twin matches the measured points of a frame.

    Raises:
        DriveError: too few points agree with the twin; the message contains the measured misfit.
    """
    solid, observed, settings = frame.shot.hits.solid, frame.observed, frame.settings.beams
    usable = observed.returned & observed.trusted
    if not usable.any():
        raise DriveError(
            f"{drive.root}: no point of frame {frame.name} fits both a beam of the sensor's pattern and a part of the "
            "twin that can be compared; pass the pattern of this sensor, or record while the sensor moves"
        )
    residual = observed.range_from(frame.shot.rays.origin) - solid.range_m
    gap = np.abs(np.nan_to_num(residual[usable], nan=1e3, posinf=1e3, neginf=1e3))
    # Without rays/ the model's laser angles may differ from the unit's; the diagnosis is to find that.
    agrees_m = settings.agrees_unsaid_m if observed.recovered else settings.agrees_m
    share = float((gap < agrees_m).mean())
    if share < settings.fewest_share:
        raise DriveError(
            f"{drive.root}: the twin does not fit frame {frame.name}: only {share:.0%} of points are within "
            f"{agrees_m} m of it, the median is {np.median(gap):.2f} m off; check frames, axes and the LiDAR's pose"
        )
    # Flat ground is the same everywhere: only upright surfaces show whether the twin belongs to this place.
    upright = usable & solid.exists & (np.abs(solid.normal[:, 2]) < settings.upright)
    standing = np.abs(residual[upright])
    share = float((standing < settings.same_m).mean()) if upright.sum() >= settings.fewest_upright else 1.0
    if not observed.recovered and share < settings.fewest_standing:
        raise DriveError(
            f"{drive.root}: the twin does not fit frame {frame.name}: only {share:.0%} of points on its "
            f"upright surfaces are within {settings.same_m:g} m, the median is {np.median(standing):.2f} m off; "
            "check that frames and twin belong together"
        )


_NOT_IN_OWN_MAP = ("mount_rotation", "mount_translation", "suspension_pitch", "time_offset", "range_scale")
_NOT_MAPPED = ("backscatter", "false_alarms", "mirror_ghost", "blooming")
_LIKE_POSES = ("mount_rotation", "mount_translation", "suspension_pitch")
_NOT_NEEDED = ("image_", "depth_", "semantic_", "instance_", "label_2", "oxts", "hits")


def drive_notes(drive: Drive, *, frames: int, bad: int, unmatched: int, has_intensity: bool) -> tuple[str, ...]:
    """Notes on missing or unusable parts of a drive.

    Args:
        drive: drive with its twin.
        frames: number of frames that are compared.
        bad, unmatched: number of their points with NaN or infinity, and of points that fit no beam.
        has_intensity: whether the points have intensities.
    """
    notes = [note for note in drive.missing if not note.startswith(_NOT_NEEDED)]
    if drive.materials_path is None:
        notes.append(
            "twin/materials.yaml is missing: reflectances are taken from colours, so intensities are unreliable"
        )
    if bad:
        notes.append(f"{bad} points with NaN or infinity were skipped")
    if unmatched:
        notes.append(f"{unmatched} points fit no beam of the sensor's pattern and were skipped")
    if (unit := intensity_unit(drive)) != 1:
        notes.append(f"intensities are bytes: they were divided by {unit:g}")
    if not has_intensity:
        notes.append("there are no intensities: this channel is omitted")
    if frames == 1:
        notes.append("only one frame: errors that vary between frames cannot be distinguished from constant ones")
    return tuple(notes)


def undetermined_effects(fitted: int, of_own_map: bool, settings: BeamSampling = DEFAULT.beams) -> tuple[str, ...]:
    """Names of effects that are not observable with this number of fitted scans, or with a map made from the scans."""
    return (
        *(_LIKE_POSES if fitted < settings.fewest_scans else ()),
        *((*_NOT_IN_OWN_MAP, *_NOT_MAPPED) if of_own_map else ()),
    )


def fit_notes(
    fitted: int, is_held_out: bool, of_own_map: bool, settings: BeamSampling = DEFAULT.beams
) -> tuple[str, ...]:
    """Notes on the number of fitted frames, on validation, and on a twin that is a map made from the scans."""
    notes = []
    if of_own_map:
        notes.append(
            "the twin is a map made from the scans, with free surface positions, reflectances and scan poses, so "
            f"{', '.join(_NOT_IN_OWN_MAP)} and a constant offset along all normals are not observable in this drive"
        )
        notes.append(
            "returns from anything that is not in the map (traffic, leaves, fog) are skipped: "
            f"{', '.join(_NOT_MAPPED)} and other spurious returns are not observable in this drive"
        )
    if fitted < settings.fewest_scans:
        count = "one frame is" if fitted == 1 else f"{fitted} frames are"
        notes.append(
            f"{count} too few to distinguish an offset of the sensor from pose errors: "
            f"{', '.join(_LIKE_POSES[:-1])} and {_LIKE_POSES[-1]} are not observable"
        )
    if not is_held_out:
        notes.append("no frame was left for validation: errors after a fit are too optimistic")
    return tuple(notes)

"""What a drive does not let one know, a sentence each."""

from __future__ import annotations

from cosim.discrepancy.pose_patterns import FEWEST_SCANS
from cosim.drives.kitti import Drive

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
    if not has_intensity:
        said.append("there are no intensities: that channel is left out")
    if frames == 1:
        said.append("one frame only: what differs from frame to frame cannot be told from what is constant")
    return tuple(said)


def fit_notes(fitted: int, is_held_out: bool) -> tuple[str, ...]:
    """Of how many frames were fitted, and whether others judged."""
    said = []
    if fitted < FEWEST_SCANS:
        count = "one frame is" if fitted == 1 else f"{fitted} frames are"
        said.append(
            f"{count} too few to tell a sensor that is off as a whole from poses that are: "
            "mount_rotation, mount_translation and suspension_pitch do not show"
        )
    if not is_held_out:
        said.append("no frame was left to judge by: errors after a fit are flattering")
    return tuple(said)

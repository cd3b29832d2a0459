"""Export formats, and a function that writes one of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cosim.drives.kitti import Drive

FORMATS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "kitti-tracking": ("kitti_sequences", "export_tracking"),
        "kitti-odometry": ("kitti_sequences", "export_odometry"),
        "semantickitti": ("kitti_sequences", "export_semantic"),
        "nuscenes": ("nuscenes", "export_nuscenes"),
        "pcd": ("clouds", "export_pcd"),
        "las": ("clouds", "export_las"),
        "mcap": ("mcap", "export_mcap"),
        "openlabel": ("openlabel", "export_openlabel"),
    }
)
"""Module of this package and function that write each; imported when they are needed."""


def export(drive: Drive, name: str, folder: Path, on_frame: Callable[[], None] = lambda: None) -> dict[str, int]:
    """Write a drive in a format.

    Args:
        drive: finished.
        name: of `FORMATS`.
        folder: made if missing; files that are there are replaced.
        on_frame: called after every frame.

    Returns:
        How many of what were written.

    Raises:
        ExportError: the drive is unfinished or has no data for the format; a library is missing.
        OutputError: the folder cannot be written.
    """
    from cosim.drives.writer import explained
    from cosim.export.source import demand_finished

    demand_finished(drive)
    module, function = FORMATS[name]
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        return getattr(import_module(f"cosim.export.{module}"), function)(drive, folder, on_frame)

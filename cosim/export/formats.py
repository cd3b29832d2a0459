"""Which formats there are, and writing one of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from cosim.drives.kitti import Drive
from cosim.drives.writer import explained
from cosim.export.clouds import export_las, export_pcd
from cosim.export.kitti_sequences import export_odometry, export_semantic, export_tracking
from cosim.export.mcap import export_mcap
from cosim.export.nuscenes import export_nuscenes
from cosim.export.openlabel import export_openlabel
from cosim.export.source import demand_finished

Exporter = Callable[[Drive, Path, Callable[[], None]], dict[str, int]]

FORMATS: Mapping[str, Exporter] = MappingProxyType(
    {
        "kitti-tracking": export_tracking,
        "kitti-odometry": export_odometry,
        "semantickitti": export_semantic,
        "nuscenes": export_nuscenes,
        "pcd": export_pcd,
        "las": export_las,
        "mcap": export_mcap,
        "openlabel": export_openlabel,
    }
)


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
        ExportError: the drive is unfinished, or lacks what the format holds; a library is missing.
        OutputError: the folder cannot be written.
    """
    demand_finished(drive)
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        return FORMATS[name](drive, folder, on_frame)

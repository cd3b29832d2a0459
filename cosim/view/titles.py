"""Title of a drive on pages."""

from __future__ import annotations

from cosim.drives.kitti import Drive


def drive_title(drive: Drive) -> str:
    """Its town or folder, and its kind."""
    config = drive.info.get("config")
    town = config.get("town") if isinstance(config, dict) else None
    root = drive.base.resolve()
    kind = f"{drive.kind} drive, LiDAR {drive.lidar}" if drive.lidar else f"{drive.kind} drive"
    folder = f"{root.parent.name}/{root.name}" if root.name in ("training", "testing") else root.name
    return f"{town}: {kind}" if town else f"{folder}: {kind}"

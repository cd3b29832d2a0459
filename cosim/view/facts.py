"""Key figures of a drive and of a frame for the page."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Drive, Frame
from cosim.view.objects import Objects, PointInstances

Facts = list[tuple[str, str]]
_SOURCES = {"hits": "traced", "boxes": "points within boxes", "none": "none"}


def drive_facts(drive: Drive) -> Facts:
    """Town, seed, size and counts; values that are not in `drive.yaml` are skipped."""
    config, counts = _mapping(drive.info.get("config")), _mapping(drive.info.get("counts"))
    facts = [("Kind", drive.kind)]
    facts += [(title, str(config[key])) for title, key in (("Town", "town"), ("Sensor", "sensor")) if key in config]
    if "seed" in drive.info:
        facts.append(("Seed", str(drive.info["seed"])))
    facts.append(("Frames", f"{len(drive):,}"))
    row = drive.point_format.layout.row_bytes
    sizes = [drive[name].path("velodyne").stat().st_size // row for name in drive.frames]
    facts.append(("Points per frame", f"{np.mean(sizes):,.0f}"))
    if drive.pattern is not None:
        facts.append(("Beam pattern", str(drive.info.get("pattern", Path(drive.pattern).name))))
    facts.append(("Sweep", f"{drive.sweep_s:g} s"))
    titles = {"labels": "Labelled objects", "instances": "Objects in the twins", "episodes": "Episodes"}
    facts += [(title, f"{counts[key]:,}") for key, title in titles.items() if isinstance(counts.get(key), int)]
    return facts


def frame_facts(frame: Frame, objects: Objects, instances: PointInstances) -> Facts:
    """Time, speed, points, labels and objects of a frame."""
    facts: Facts = []
    if frame.has("twin/frames"):
        twin = frame.twin
        facts.append(("Time", f"{twin.time_s:.1f} s"))
        facts.append(("Ego speed", f"{3.6 * np.linalg.norm(twin.ego.velocity_mps):.0f} km/h"))
    facts.append(("Points", f"{len(frame.points):,}"))
    if frame.has("label_2"):
        classes = Counter(frame.labels.cared_for.type)
        facts.append(("Labels", ", ".join(f"{count} {name}" for name, count in classes.most_common()) or "none"))
    if objects.source != "none":
        hit = np.unique(instances.number[instances.number >= 0])
        facts.append(("Objects hit by points", f"{len(hit)} of {len(objects)}"))
        facts.append(("Object of a point", _SOURCES[instances.source]))
    return facts


def _mapping(value: object) -> dict[str, object]:
    return value if isinstance(value, dict) else {}

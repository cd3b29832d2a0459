"""ASAM OpenLABEL: one JSON file a sequence, a cuboid a frame for every object, in LiDAR axes.

ASAM OpenLABEL 1.0.0 concept paper and schema: `coordinate_systems` with poses, `streams`, `frames`, `objects`. A
cuboid's ten values are x y z, a quaternion x y z w, and length, width, height.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cosim.drives.kitti import Drive, Frame, points_in_boxes
from cosim.drives.kitti.level import levelled
from cosim.export.source import ExportedTracks, Sequence, WorldPoses, demand, instance_boxes, lidar_frames, sequences

_WORLD, _EGO, _LIDAR = "world", "vehicle-iso8855", "lidar"


def export_openlabel(drive: Drive, folder: Path, on_frame: Callable[[], None]) -> dict[str, int]:
    """Write `SEQUENCE.json` for every simulation of a drive."""
    demand(drive, "twin/frames", "openlabel")
    found, objects = sequences(drive), 0
    for sequence in found:
        document = _document(drive, sequence, on_frame)
        objects += len(document["openlabel"]["objects"])
        (folder / f"{sequence.name}.json").write_text(json.dumps(document), encoding="utf-8")
    return {"frames": len(drive), "sequences": len(found), "objects": objects}


def _document(drive: Drive, sequence: Sequence, on_frame: Callable[[], None]) -> dict[str, Any]:
    first = sequence.frames[0]
    frames: dict[str, Any] = {}
    seen: dict[str, list[int]] = {}
    names: dict[str, tuple[str, str]] = {}
    tracks, world = ExportedTracks(), WorldPoses(drive)
    for index, frame in enumerate(sequence):
        objects = {}
        for row, (box, points) in enumerate(_cuboids(frame)):
            thing = frame.twin.instances[row]
            key = str(tracks.number(thing.id))  # the schema wants whole numbers
            names[key] = thing.id, thing.kind
            seen.setdefault(key, []).append(index)
            numbers = [
                {"name": "points", "val": points},
                {"name": "speed_mps", "val": float(np.linalg.norm(thing.velocity_mps))},
            ]
            cuboid = {"name": "box", "val": box, "coordinate_system": _LIDAR}
            objects[key] = {"object_data": {"cuboid": [cuboid], "num": numbers}}
        frames[str(index)] = {"frame_properties": _properties(drive, frame, world), "objects": objects}
        on_frame()
    return {
        "openlabel": {
            "metadata": {"schema_version": "1.0.0", "name": drive.root.name, "annotator": "cosim"},
            "coordinate_systems": _coordinate_systems(drive, first),
            "streams": {
                name: {
                    "type": "lidar",
                    "uri": str(seen.path("velodyne").parent.relative_to(drive.base)),
                    "description": seen.twin.lidar.pattern,
                }
                for name, seen in _lidars(drive, first).items()
            }
            | {part: {"type": "camera", "uri": part} for part in first.twin.cameras if first.has(part)},
            "frame_intervals": [{"frame_start": 0, "frame_end": len(sequence) - 1}],
            "objects": {
                key: {"name": names[key][0], "type": names[key][1], "frame_intervals": _intervals(rows)}
                for key, rows in seen.items()
            },
            "frames": frames,
        }
    }


def _cuboids(frame: Frame) -> list[tuple[list[float], int]]:
    """Cuboid of each instance in LiDAR axes, and how many points lie in its box."""
    boxes = instance_boxes(frame.twin)
    upright = levelled(frame)
    points = points_in_boxes(upright.points, instance_boxes(upright.twin)).sum(1)
    to_lidar = np.linalg.inv(frame.twin.ego.pose @ frame.twin.lidar.pose_ego)
    cuboids = []
    for row, thing in enumerate(frame.twin.instances):
        turned = Rotation.from_matrix((to_lidar @ thing.pose)[:3, :3]).as_quat()
        cuboids.append(([*boxes.centre[row].tolist(), *turned.tolist(), *boxes.size[row].tolist()], int(points[row])))
    return cuboids


def _properties(drive: Drive, frame: Frame, world: WorldPoses) -> dict[str, Any]:
    """Time of a frame, pose of its vehicle, and its files."""
    pose = world.of(frame, frame.twin.ego.pose)
    streams = {
        name: {"uri": str(seen.path("velodyne").relative_to(drive.base))}
        for name, seen in _lidars(drive, frame).items()
    }
    for part in frame.twin.cameras:
        if frame.has(part):
            streams[part] = {"uri": str(frame.path(part).relative_to(drive.base))}
    transform = {"src": _WORLD, "dst": _EGO, "transform_src_to_dst": {"matrix4x4": pose.reshape(-1).tolist()}}
    return {
        "timestamp": frame.twin.time_s,
        "streams": {name: {"stream_properties": {"sync": {}}, **values} for name, values in streams.items()},
        "transforms": {f"{_WORLD}_to_{_EGO}": transform},
    }


def _lidars(drive: Drive, frame: Frame) -> dict[str, Frame]:
    """A frame by LiDAR; the first one, in whose axes cuboids are, is `lidar`."""
    others = list(lidar_frames(drive, frame).items())[1:]
    return {_LIDAR: frame} | {f"{_LIDAR}_{name}": seen for name, seen in others}


def _coordinate_systems(drive: Drive, frame: Frame) -> dict[str, Any]:
    """World, vehicle and sensors, each with its pose in its parent."""
    sensors = {name: seen.twin.lidar.pose_ego for name, seen in _lidars(drive, frame).items()}
    sensors |= {part: camera.pose_ego for part, camera in frame.twin.cameras.items() if frame.has(part)}
    systems: dict[str, Any] = {
        _WORLD: {"type": "scene_cs", "parent": "", "children": [_EGO]},
        _EGO: {"type": "local_cs", "parent": _WORLD, "children": list(sensors)},
    }
    for name, pose in sensors.items():
        systems[name] = {
            "type": "sensor_cs",
            "parent": _EGO,
            "children": [],
            "pose_wrt_parent": {"matrix4x4": pose.reshape(-1).tolist()},
        }
    return systems


def _intervals(rows: list[int]) -> list[dict[str, int]]:
    """Runs of consecutive numbers."""
    runs = [[rows[0], rows[0]]]
    for row in rows[1:]:
        if row == runs[-1][1] + 1:
            runs[-1][1] = row
        else:
            runs.append([row, row])
    return [{"frame_start": start, "frame_end": end} for start, end in runs]

"""nuScenes' tables and samples: a scene a simulation, a sample a frame.

Caesar et al., nuScenes, CVPR 2020; docs/schema_nuscenes.md of nuscenes-devkit. Points are x y z, intensity 0–255 and
ring, float32; boxes are width, length, height; quaternions are w x y z.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cosim.drives.kitti import Drive, Frame, points_in_boxes
from cosim.drives.kitti.level import levelled
from cosim.drives.twin.frame import Instance, TwinCamera
from cosim.export.source import Sequence, WorldPoses, demand, instance_boxes, lidar_frames, sequences

_CATEGORIES = {
    "car": "vehicle.car",
    "van": "vehicle.car",
    "truck": "vehicle.truck",
    "bus": "vehicle.bus.rigid",
    "tram": "vehicle.bus.rigid",  # nuScenes has no trams
    "motorcycle": "vehicle.motorcycle",
    "cyclist": "vehicle.bicycle",
    "pedestrian": "human.pedestrian.adult",
    "person_sitting": "human.pedestrian.adult",
}
_MOVING = {"vehicle": ("vehicle.parked", "vehicle.moving"), "cycle": ("cycle.with_rider",) * 2}
_MOVING |= {"pedestrian": ("pedestrian.standing", "pedestrian.moving")}
_CHANNELS = {"image_0": "CAM_FRONT_LEFT_GRAY", "image_1": "CAM_FRONT_RIGHT_GRAY", "image_2": "CAM_FRONT"}
_CHANNELS |= {"image_3": "CAM_FRONT_RIGHT"}
_VISIBILITY = (("1", 0.0), ("2", 0.4), ("3", 0.6), ("4", 0.8))
_US = 1e6
_FARTHEST_M = 100.0
VERSION = "v1.0-mini"


def export_nuscenes(drive: Drive, folder: Path, on_frame: Callable[[], None]) -> dict[str, int]:
    """Write `v1.0-mini/*.json`, `samples/` and an empty map.

    Road users with a point in their box, or within 100 m, are annotated.
    """
    demand(drive, "twin/frames", "nuscenes")
    tables = _Tables(drive, folder)
    found = sequences(drive)
    for sequence in found:
        tables.add(sequence, on_frame)
    tables.write()
    return {"frames": len(drive), "scenes": len(found), "annotations": len(tables.rows["sample_annotation"])}


class _Tables:
    """The thirteen tables while they grow."""

    def __init__(self, drive: Drive, folder: Path) -> None:
        self._drive, self._folder, self._world = drive, folder, WorldPoses(drive)
        names = ("category", "attribute", "visibility", "instance", "sensor", "calibrated_sensor", "ego_pose", "log")
        names += ("scene", "sample", "sample_data", "sample_annotation", "map")
        self.rows: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
        for name in sorted(set(_CATEGORIES.values())):
            self._row("category", name, name=name, description="")
        for name in sorted({word for pair in _MOVING.values() for word in pair}):
            self._row("attribute", name, name=name, description="")
        for token, share in _VISIBILITY:
            text = f"visibility from {share:.0%}"
            self.rows["visibility"].append({"token": token, "level": text, "description": text})
        self._log = self._row(
            "log", "log", logfile=drive.root.name, vehicle="ego", date_captured="2000-01-01", location="simulated"
        )
        self._row("map", "map", category="semantic_prior", filename="maps/none.png", log_tokens=[self._log])

    def add(self, sequence: Sequence, on_frame: Callable[[], None]) -> None:
        """Enter a sequence as a scene."""
        number = len(self.rows["scene"])
        samples = [_token(f"sample-{frame.name}") for frame in sequence]
        scene = self._row(
            "scene",
            f"scene-{number}",
            log_token=self._log,
            nbr_samples=len(samples),
            first_sample_token=samples[0],
            last_sample_token=samples[-1],
            name=f"scene-{number:04d}",
            description=f"{self._drive.root.name}, frames {sequence.frames[0].name} to {sequence.frames[-1].name}",
        )
        tracks: dict[str, list[dict[str, Any]]] = {}
        data: dict[str, list[dict[str, Any]]] = {}
        for index, frame in enumerate(sequence):
            stamp = round(frame.twin.time_s * _US)
            self._row(
                "sample",
                f"sample-{frame.name}",
                timestamp=stamp,
                prev=samples[index - 1] if index else "",
                next=samples[index + 1] if index + 1 < len(samples) else "",
                scene_token=scene,
            )
            self._data(frame, samples[index], stamp, data)
            self._annotations(frame, samples[index], scene, tracks)
            on_frame()
        for rows in (*data.values(), *tracks.values()):
            _chain(rows)
        for rows in tracks.values():
            first = rows[0]
            self.rows["instance"].append(
                {
                    "token": first["instance_token"],
                    "category_token": _token(_CATEGORIES[first.pop("kind")]),
                    "nbr_annotations": len(rows),
                    "first_annotation_token": first["token"],
                    "last_annotation_token": rows[-1]["token"],
                }
            )
            for row in rows[1:]:
                del row["kind"]

    def write(self) -> None:
        """Write the tables, and the map they name."""
        root = self._folder / VERSION
        root.mkdir(parents=True, exist_ok=True)
        for name, rows in self.rows.items():
            (root / f"{name}.json").write_text(json.dumps(rows, indent=0), encoding="utf-8")
        import cv2

        (self._folder / "maps").mkdir(exist_ok=True)
        cv2.imwrite(str(self._folder / "maps" / "none.png"), np.zeros((8, 8), np.uint8))

    def _data(self, frame: Frame, sample: str, stamp: int, data: dict[str, list[dict[str, Any]]]) -> None:
        ego = self._world.of(frame, frame.twin.ego.pose)
        pose = self._row("ego_pose", f"pose-{frame.name}", timestamp=stamp, **_placed(ego))
        files = []
        for name, seen in lidar_frames(self._drive, frame).items():
            channel = f"LIDAR_{name.upper()}"
            file = self._cloud(seen, channel)
            sensor = self._sensor(channel, "lidar", seen.twin.lidar.pose_ego, [])
            files.append((channel, sensor, file, "pcd", 0, 0))
        for part, camera in frame.twin.cameras.items():
            source = frame.find(part)
            if source is None:
                continue
            channel = _CHANNELS.get(part) or f"CAM_{part.removeprefix('image_').upper()}"
            pose_ego, intrinsic = _pinhole(camera)
            token = self._sensor(channel, "camera", pose_ego, intrinsic.tolist())
            target = self._folder / "samples" / channel / source.name
            _link(source, target)
            files.append(
                (channel, token, f"samples/{channel}/{source.name}", source.suffix[1:], camera.width, camera.height)
            )
        for channel, token, name, kind, width, height in files:
            self._row(
                "sample_data",
                f"data-{channel}-{frame.name}",
                sample_token=sample,
                ego_pose_token=pose,
                calibrated_sensor_token=token,
                timestamp=stamp,
                fileformat=kind,
                is_key_frame=True,
                height=height,
                width=width,
                filename=name,
                prev="",
                next="",
            )
            data.setdefault(channel, []).append(self.rows["sample_data"][-1])

    def _cloud(self, frame: Frame, channel: str) -> str:
        """Write a scan; its path in the folder."""
        cloud = np.column_stack([frame.points[:, :3], frame.points[:, 3] * 255, frame.rays.ring]).astype("<f4")
        path = self._folder / "samples" / channel / f"{frame.name}.pcd.bin"
        path.parent.mkdir(parents=True, exist_ok=True)
        cloud.tofile(path)
        return f"samples/{channel}/{path.name}"

    def _sensor(self, channel: str, modality: str, pose_ego: np.ndarray, intrinsic: list) -> str:
        """The token of a sensor at its place, entered when it is new."""
        sensor = _token(f"sensor-{channel}")
        if not any(row["token"] == sensor for row in self.rows["sensor"]):
            self._row("sensor", f"sensor-{channel}", channel=channel, modality=modality)
        placed = _placed(pose_ego)
        token = _token(f"calibrated-{channel}-{json.dumps(placed)}")
        if not any(row["token"] == token for row in self.rows["calibrated_sensor"]):
            self.rows["calibrated_sensor"].append(
                {"token": token, "sensor_token": sensor, "camera_intrinsic": intrinsic, **placed}
            )
        return token

    def _annotations(self, frame: Frame, sample: str, scene: str, tracks: dict[str, list[dict[str, Any]]]) -> None:
        frame = levelled(frame)
        boxes = instance_boxes(frame.twin)
        points = points_in_boxes(frame.points, boxes).sum(1)
        near = np.linalg.norm(boxes.centre[:, :2], axis=1) < _FARTHEST_M
        for row in np.flatnonzero((points > 0) | near).tolist():
            thing = frame.twin.instances[row]
            if thing.kind not in _CATEGORIES:
                continue
            middle = self._world.of(frame, thing.pose)
            middle[:3, 3] += thing.pose[:3, 2] * thing.height_m / 2
            self._row(
                "sample_annotation",
                f"annotation-{frame.name}-{thing.id}",
                sample_token=sample,
                instance_token=_token(f"instance-{scene}-{thing.id}"),
                visibility_token="4" if points[row] else "1",
                attribute_tokens=[_token(_attribute(thing))],
                size=[thing.width_m, thing.length_m, thing.height_m],
                num_lidar_pts=int(points[row]),
                num_radar_pts=0,
                prev="",
                next="",
                **_placed(middle),
            )
            entry = self.rows["sample_annotation"][-1]
            entry["kind"] = thing.kind
            tracks.setdefault(thing.id, []).append(entry)

    def _row(self, table: str, key: str, **values: Any) -> str:
        token = _token(key)
        self.rows[table].append({"token": token, **values})
        return token


def _pinhole(camera: TwinCamera) -> tuple[np.ndarray, np.ndarray]:
    """Pose (4, 4) of a camera's own centre in the ego's axes, and its matrix K (3, 3)."""
    intrinsic, pose = camera.P[:, :3], camera.pose_ego.copy()
    pose[:3, 3] += pose[:3, :3] @ -np.linalg.solve(intrinsic, camera.P[:, 3])
    return pose, intrinsic


def _placed(pose: np.ndarray) -> dict[str, list[float]]:
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    return {"translation": pose[:3, 3].tolist(), "rotation": [w, x, y, z]}


def _attribute(thing: Instance) -> str:
    group = _CATEGORIES[thing.kind].split(".")[1]
    group = {"motorcycle": "cycle", "bicycle": "cycle", "pedestrian": "pedestrian"}.get(group, "vehicle")
    return _MOVING[group][bool(np.linalg.norm(thing.velocity_mps) > 0.1)]


def _chain(rows: list[dict[str, Any]]) -> None:
    for before, after in pairwise(rows):
        before["next"], after["prev"] = after["token"], before["token"]


def _token(name: str) -> str:
    return hashlib.md5(name.encode(), usedforsecurity=False).hexdigest()


def _link(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    target.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        os.link(source, target)
    if not target.exists():
        shutil.copyfile(source, target)

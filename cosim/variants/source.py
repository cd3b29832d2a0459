"""Source drive of variants: stored hits, images, and the twin for tracing again."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

import numpy as np

from assets.documents import parse_json
from cosim.capture.camera_views import view_of_frame
from cosim.capture.rig_sensors import folder_of, measuring_rng
from cosim.drives.files import read_text
from cosim.drives.kitti.drive import Drive
from cosim.drives.kitti.frame import Frame
from cosim.drives.twin.scene import TwinScenes, ego_motion, lidar_pose, scene_instances
from cosim.drives.writer import DriveWriter
from cosim.variants.request import VariantError
from sensors.camera_view import CameraView
from sensors.effects.base import LabelEffect
from sensors.hits import Hits
from sensors.hits_file import load_hits
from sensors.motion import EgoMotion
from sensors.pattern import Pattern, load_pattern
from sensors.scene import Instances, Scene
from sensors.sensor_file import EXACT_ANNOTATOR
from sensors.sensor_model import load_sensor

_LINKED = ("image_0", "image_1", "image_2", "image_3", "depth_0", "calib", "oxts", "twin/frames")
_IMAGES = ("image", "depth", "label")  # prefixes of the image and label folders of other rigs
_LIDAR_FOLDERS = ("velodyne", "rays", "hits", "calib")


class VariantSource:
    """A simulated drive.

    Args:
        path: folder of the drive.
        threads: number of threads per ray query.

    Raises:
        DriveError: the folder is not a drive.
        VariantError: the drive has no stored hits, or no pattern.
    """

    def __init__(self, path: Path, *, threads: int = 1) -> None:
        self.drive = Drive(path)
        missing = [name for name in self.drive.frames if not self.drive[name].has("hits")]
        if missing:
            raise VariantError(
                f"{self.drive.root}: no hits/{missing[0]}.npz, {len(missing)} of {len(self.drive)} frames have no "
                "hits; variants are made from stored hits: simulate the drive with store_hits: true"
            )
        if self.drive.pattern is None:
            raise VariantError(f"{self.drive.root}: no pattern.yaml; finish the drive with cosim run, or add the file")
        self.pattern: Pattern = load_pattern(self.drive.pattern)
        self.rays = self.pattern.rays()
        self.scenes = TwinScenes(self.drive, threads=threads)

    @property
    def seed(self) -> int:
        """Seed of the run."""
        return int(self.drive.info.get("seed", 0))

    @cached_property
    def annotator(self) -> tuple[LabelEffect, ...]:
        """Label effects of the annotator of the run; none if its boxes are exact."""
        path, config = self.drive.sensor_path, self.drive.info.get("config")
        settings = config.get("labels") if isinstance(config, dict) else None
        annotator = settings.get("annotator") if isinstance(settings, dict) else None
        if path is None or annotator in (None, EXACT_ANNOTATOR):
            return ()
        return tuple(effect for effect in load_sensor(path).effects if isinstance(effect, LabelEffect))

    def rng(self, name: str) -> np.random.Generator:
        """Random generator with which `cosim run` measures a frame."""
        return measuring_rng(self.seed, name, self.drive.lidar)

    @cached_property
    def identity(self) -> dict[str, str | int]:
        """Name, number of frames and manifest checksum, which identify the drive."""
        manifest = self.drive.base / "manifest.jsonl"
        content = manifest.read_bytes() if manifest.is_file() else "\n".join(self.drive.frames).encode()
        digest = hashlib.sha256(content).hexdigest()
        return {"drive": self.drive.root.resolve().name, "frames": len(self.drive), "manifest_sha256": digest}

    @cached_property
    def sha256(self) -> Mapping[str, str]:
        """Checksums of the drive's files, as its manifest lists them."""
        prefix, checksums = folder_of(self.drive.lidar), {}
        for entry in DriveWriter(self.drive.base).manifest().values():
            for file, digest in zip(entry.get("files", ()), entry.get("sha256", ()), strict=False):
                if prefix and file.startswith(prefix):
                    checksums[file.removeprefix(prefix)] = digest
                elif not prefix or file.partition("/")[0] not in _LIDAR_FOLDERS:
                    checksums[file] = digest
        return checksums

    def world(self, name: str) -> str:
        """Name of a frame's static world; empty if the drive has only one."""
        path = self.drive[name].find("twin/frames")
        if path is None or not (self.drive.base / "twin/worlds").is_dir():
            return ""
        try:
            return str(parse_json(read_text(path)).get("static", ""))
        except (ValueError, AttributeError):
            return ""  # the reader of the frame reports the error

    def linked_files(self, name: str) -> dict[str, Path]:
        """Files of a frame that all variants share, by path in the drive."""
        files = {part: self.drive[name].find(part) for part in self._linked}
        return {f"{part}/{path.name}": path for part, path in files.items() if path is not None}

    @cached_property
    def _linked(self) -> tuple[str, ...]:
        """Folders that all variants share; for a LiDAR other than the first, the twin's frames are rewritten."""
        if not self.drive[self.drive.frames[0]].reference:
            folders = _LINKED
        else:
            names = (path.name for path in self.drive.base.iterdir() if path.is_dir())
            images = sorted(
                name for name in names if name.partition("_")[0] in _IMAGES and not name.startswith("label_2")
            )
            folders = (*images, "calib", "oxts", "twin/frames")
        return tuple(part for part in folders if not (self.drive.lidar and part == "twin/frames"))

    def common_files(self) -> dict[str, Path]:
        """Files of the drive, not of a frame, that all variants share, by path in the drive."""
        root = self.drive.base
        files = (*(root / "ImageSets").glob("*.txt"), root / "twin/materials.yaml", root / "twin/static.glb")
        meshes = (path for folder in ("static", "worlds", "models") for path in (root / "twin" / folder).glob("*.glb"))
        return {path.relative_to(root).as_posix(): path for path in (*files, *meshes) if path.is_file()}


class SourceFrame:
    """One frame of a source; its parts are read on first use and cached."""

    def __init__(self, source: VariantSource, name: str) -> None:
        self._source = source
        self.name = name
        self.frame: Frame = source.drive[name]

    @cached_property
    def hits(self) -> Hits:
        """Stored hits."""
        return load_hits(self.frame.hits_path, self._source.rays)

    @cached_property
    def instances(self) -> Instances:
        """Movable objects."""
        return scene_instances(self.frame.twin.instances)

    @property
    def ego(self) -> EgoMotion:
        """Motion of the vehicle that carries the sensors."""
        return ego_motion(self.frame.twin)

    @cached_property
    def lidar_pose(self) -> np.ndarray:
        """Nominal world pose of the LiDAR, (4, 4)."""
        if self.frame.has("twin/frames"):
            return lidar_pose(self.frame.twin)
        return self.hits.pose

    @property
    def time_s(self) -> float:
        """Pose time [s]; 0 without a twin."""
        return self.frame.twin.time_s if self.frame.has("twin/frames") else 0.0

    @property
    def scene(self) -> Scene:
        """Scene of the frame."""
        return self._source.scenes.of(self.frame)

    @cached_property
    def camera(self) -> CameraView | None:
        """View of the grayscale camera; None without its images."""
        return view_of_frame(self.frame, self.frame.calibration, self.lidar_pose)

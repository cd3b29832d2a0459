"""One frame of a drive; its parts are read on demand."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import TypeVar

import numpy as np

from cosim.drives.kitti.calibration import Calibration, read_calibration
from cosim.drives.kitti.images import read_depth, read_image, read_instances
from cosim.drives.kitti.label_axes import LabelAxes, in_camera_axes
from cosim.drives.kitti.labels import Labels, read_labels
from cosim.drives.kitti.oxts import Oxts, read_oxts
from cosim.drives.kitti.point_format import PLAIN, PointFormat, StoredScan
from cosim.drives.kitti.rays import PointRays, read_rays
from cosim.drives.kitti.rings import recover_rays
from cosim.drives.twin.frame import TwinFrame, read_frame
from cosim.errors import DriveError

_LOG = logging.getLogger(__name__)
_T = TypeVar("_T")

#: Folder of a part → suffixes its files may have, the one we write first.
PARTS = {
    "velodyne": (".bin",),
    "calib": (".txt",),
    "rays": (".npz",),
    "hits": (".npz",),
    **{f"image_{camera}": (".png", ".jpg") for camera in range(4)},
    **{f"{kind}_{camera}": (".png",) for kind in ("depth", "semantic", "instance") for camera in range(4)},
    "label_2": (".txt",),
    "label_2_exact": (".txt",),
    "oxts": (".txt",),
    "twin/frames": (".json",),
    "twin/trust": (".npz",),
}


_OF_LIDAR = ("velodyne", "calib", "rays", "hits")
_OF_REFERENCE = ("image_2", "depth_2", "semantic_2", "instance_2")
_OF_CAMERAS = {"image": (".png", ".jpg"), "depth": (".png",), "semantic": (".png",), "instance": (".png",)}
_OF_CAMERAS |= {"label": (".txt",)}


def suffixes(part: str) -> tuple[str, ...]:
    """File name extensions of a part; the first one is used for writing.

    Raises:
        KeyError: there is no such part.
    """
    return PARTS[part] if part in PARTS else _OF_CAMERAS[part.partition("_")[0]]


@dataclass(frozen=True, eq=False)
class Frame:
    """The parts of one frame, each read once, at its first use. All raise `CosimError` on broken files.

    Attributes:
        name: as in `velodyne/NAME.bin`.
        root: the folder that holds `velodyne/`.
        sweep_s: duration of a turn, to make up firing times with.
        elevations_rad: (k,) elevations of the pattern's rings, if known; helps to recover rings.
        format: layout of the file of points and meaning of its columns.
        base: holds what LiDARs share, where a drive has several; None: the root.
        lidar: name of the LiDAR, where it is not the drive's first.
        reference: name of the camera that labels refer to, where the rig is not KITTI's.
        parts: folder of each part that is not in the folder of its name, relative to the root.
        common_calibration: file of the calibration, where it is the same for all frames.
        label_axes: axes in which labelled boxes are upright.
    """

    name: str
    root: Path
    sweep_s: float = 0.1
    elevations_rad: np.ndarray | None = None
    format: PointFormat = PLAIN
    base: Path | None = None
    lidar: str = ""
    reference: str = ""
    parts: Mapping[str, str] = field(default_factory=dict)
    common_calibration: Path | None = None
    label_axes: LabelAxes = "camera"

    def find(self, part: str) -> Path | None:
        """The file of a part (a folder such as `label_2`), or None if it is absent.

        `image_2` and its like are those of the camera that labels refer to, whatever it is called.
        """
        if self.reference and part in _OF_REFERENCE:
            part = f"{part[:-2]}_{self.reference}"
        if part == "calib" and self.common_calibration is not None:
            return self.common_calibration
        root = self.root if self.base is None or part in _OF_LIDAR else self.base
        candidates = [root / self.parts.get(part, part) / (self.name + suffix) for suffix in suffixes(part)]
        return next((path for path in candidates if path.is_file()), None)

    def has(self, part: str) -> bool:
        """Whether a part is there."""
        return self.find(part) is not None

    def path(self, part: str) -> Path:
        """The file of a part.

        Raises:
            DriveError: it is absent.
        """
        found = self.find(part)
        if found is None:
            file = f"{self.parts.get(part, part)}/{self.name}{suffixes(part)[0]}"
            raise DriveError(f"{self.root}: no {file}; add it, or leave out what needs {part}/")
        return found

    @cached_property
    def points(self) -> np.ndarray:
        """(n, 4) float32 x, y, z [m] in LiDAR axes and intensity; rows that are no returns are left out."""
        return self._scan.points

    @cached_property
    def has_intensity(self) -> bool:
        """Whether intensities were recorded: not all of the finite points' are zero."""
        return self.format.has_intensity and bool(self.points[:, 3].any())

    @property
    def bad_points(self) -> int:
        """Number of rows of the file that were left out."""
        return int((~self._scan.is_used).sum())

    @property
    def left_out(self) -> Mapping[str, int]:
        """Number of rows of the file that were left out, by reason."""
        return self._scan.left_out

    @cached_property
    def rays(self) -> PointRays:
        """The beam of every point; `rays.recovered` says whether it was made up from their order."""
        file = self.find("rays")
        if file is not None:
            return read_rays(file, points=len(self._scan.is_used))[self._scan.is_used]
        return recover_rays(self.points, self.sweep_s, self.elevations_rad, str(self.path("velodyne")))

    @property
    def bad_rays(self) -> PointRays | None:
        """Beams of the rows that were left out; None if the drive has no beam numbers."""
        file, used = self.find("rays"), self._scan.is_used
        return None if file is None else read_rays(file, points=len(used))[~used]

    @cached_property
    def calibration(self) -> Calibration:
        """The calibration."""
        return self._read("calib", read_calibration)

    @cached_property
    def labels(self) -> Labels:
        """The labelled objects, `DontCare` regions included; boxes upright in LiDAR axes in KITTI's convention."""
        labels = self._read("label_2", read_labels)
        return labels if self.label_axes == "camera" else in_camera_axes(labels, self.calibration)

    @cached_property
    def exact_labels(self) -> Labels:
        """The labels before label effects, those of `label_2` where a drive keeps no others."""
        return self._read("label_2_exact", read_labels) if self.has("label_2_exact") else self.labels

    @cached_property
    def oxts(self) -> Oxts:
        """The GPS/IMU record."""
        return self._read("oxts", read_oxts)

    @cached_property
    def twin(self) -> TwinFrame:
        """Poses and motion of everything at the pose time; its `lidar` is this frame's."""
        twin = self._read("twin/frames", read_frame)
        return twin.seen_by(self.lidar) if self.lidar else twin

    @cached_property
    def depth(self) -> np.ndarray:
        """Depth of camera 0, (h, w) float32 metres, 0 where there is nothing."""
        return self._read("depth_0", read_depth)

    def image(self, part: str = "image_2") -> np.ndarray:
        """An image: (h, w) uint8 if gray or `semantic_2`, (h, w, 3) uint8 RGB if coloured. Not kept."""
        return self._read(part, read_image)

    def instances(self, part: str = "instance_2") -> np.ndarray:
        """(h, w) uint16 instance of each pixel: row of the twin's instances + 1, 0 for the background. Not cached."""
        return self._read(part, read_instances)

    @property
    def hits_path(self) -> Path:
        """The stored hits of a simulated frame."""
        return self.path("hits")

    @property
    def static_paths(self) -> tuple[Path, ...]:
        """The glTF files of this frame's static world.

        Raises:
            DriveError: there are none.
        """
        twin = (self.base or self.root) / "twin"
        named = self.twin.static if self.has("twin/frames") else None
        wanted = [twin / named] if named else [twin / "static.glb", twin / "static"]
        for position in wanted:
            files = [position] if position.is_file() else sorted(position.glob("*.glb"))
            if files:
                return tuple(files)
        raise DriveError(
            f"{self.root}: no static world at {' or '.join(f'twin/{p.relative_to(twin)}' for p in wanted)}; "
            "write one, or make a twin from labels with `cosim twin`"
        )

    @cached_property
    def _scan(self) -> StoredScan:
        stored = self._read("velodyne", self.format.read)
        if not stored.is_used.all():
            _warn_of_bad(self.path("velodyne"), len(stored.is_used), tuple(stored.left_out.items()))
        return stored

    def _read(self, part: str, reader: Callable[[Path], _T]) -> _T:
        return reader(self.path(part))


@cache
def _warn_of_bad(path: Path, count: int, left_out: tuple[tuple[str, int], ...]) -> None:
    """Once a file, however often it is read."""
    reasons = ", ".join(f"{number} {reason}" for reason, number in left_out)
    bad = sum(number for _, number in left_out)
    _LOG.warning("%s: left out %d of %d points (%s)", path, bad, count, reasons)

"""`Drive`: a folder of frames, simulated or measured."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cosim.drives.files import is_safe_name, read_mapping
from cosim.drives.kitti.frame import Frame
from cosim.drives.kitti.label_axes import AXES, LabelAxes, infer_label_axes, is_tilted
from cosim.drives.kitti.layout import LIDARS, find_layout, lidar_folder, list_scans, read_manifest, read_split
from cosim.drives.kitti.point_format import OPTIONS, PLAIN, PointFormat, drive_options, find_point_format
from cosim.errors import CosimError, DriveError, FormatError

_LOG = logging.getLogger(__name__)
_LABELLED = 8  # frames from which the axes of labels are inferred
_SWEEP_S = 0.1  # HDL-64E at 10 Hz, as in KITTI
_OF_FIRST = ("pattern", "sweep_s", "sensor", *OPTIONS)  # keys of drive.yaml that describe the first LiDAR
_CONSEQUENCES = {
    "rays": "rings and firing times are recovered from the order of the points",
    "image_0": "no grayscale images",
    "image_2": "no colour images",
    "depth_0": "no depth images",
    "label_2": "no labelled objects",
    "oxts": "no GPS/IMU records",
    "twin/frames": "no poses: beams cannot be traced again",
}


class Drive:
    """The frames of a folder, in our layout, KITTI's, or that of KITTI's raw drives.

    Usage: `drive = Drive("out"); drive["000000"].points`, or `for frame in drive: …`.

    Attributes:
        root: the folder that holds `velodyne/` and `calib/`.
        base: the folder that holds what a drive's LiDARs share: the root, or for `lidars/NAME` that above.
        lidar: name of the additional LiDAR whose scans these are; empty for the first LiDAR.
        frames: names of all frames, sorted. Where there is a `manifest.jsonl`, those it lists as finished.
        info: what `drive.yaml` says; empty without one.
        kind: `simulated` or `measured`.
        sweep_s: duration of a turn of the head.
        missing: what is absent, a sentence each.
    """

    def __init__(self, path: str | Path) -> None:
        """Open the drive at `path`.

        Raises:
            DriveError: no folder, no `velodyne/` or `calib/`, no frame, or a value of `drive.yaml` out of bounds.
            FormatError: `drive.yaml`, the pattern or the manifest cannot be read.
        """
        layout = find_layout(Path(path))
        self.root, self.base, self.lidar = layout.root, layout.base, layout.lidar
        self._image_sets, self._parts, self._calibration = layout.image_sets, layout.parts, layout.calibration
        self._scans = self.root / layout.parts.get("velodyne", "velodyne")
        scans = list_scans(self._scans)
        manifest = self.base / "manifest.jsonl"
        finished = set(read_manifest(manifest)) if manifest.is_file() else set(scans)
        self.frames: tuple[str, ...] = tuple(name for name in scans if name in finished)
        if not self.frames:
            state = "manifest.jsonl lists no finished scan of it" if scans else "it holds no .bin file"
            raise DriveError(f"{self._scans}: {state}; a drive needs at least one frame")
        self._lost = len(finished - set(scans))
        self._known = frozenset(self.frames)
        self.info: Mapping[str, Any] = self._said()
        self.kind: Literal["simulated", "measured"] = self._find_kind()
        self.sweep_s = self._find_sweep()
        drive_options(self.info, self.base / "drive.yaml")  # raises

    def __len__(self) -> int:
        return len(self.frames)

    def __iter__(self) -> Iterator[Frame]:
        return (self[name] for name in self.frames)

    def __contains__(self, name: object) -> bool:
        return name in self._known

    def __getitem__(self, name: str) -> Frame:
        """The frame of a name; its parts are read when used.

        Raises:
            DriveError: no such frame.
        """
        if name not in self._known:
            raise DriveError(
                f"{self.root}: no frame {name!r}; it has {len(self)}, {self.frames[0]} to {self.frames[-1]}"
            )
        return self._frame(name, self.label_axes[0])

    def _frame(self, name: str, label_axes: LabelAxes) -> Frame:
        return Frame(
            name,
            self.root,
            self.sweep_s,
            self._elevations_rad,
            self.point_format,
            self.base if self.lidar else None,
            self.lidar,
            self._reference,
            self._parts,
            self._calibration,
            label_axes,
        )

    @cached_property
    def label_axes(self) -> tuple[LabelAxes, str]:
        """Axes in which labelled boxes are upright, and why, in a sentence; empty where that is no question.

        Raises:
            DriveError: `label_axes` of `drive.yaml` is neither `camera` nor `lidar`.
        """
        stated = self.info.get("label_axes")
        if stated is not None:
            if stated not in AXES:
                raise DriveError(f"{self.base / 'drive.yaml'}: label_axes is {stated!r}; write camera or lidar")
            return stated, ""
        if self.kind == "simulated":
            return "camera", ""
        chosen = self.frames[:: max(1, len(self.frames) // _LABELLED)][:_LABELLED]
        frames = [self._frame(name, "camera") for name in chosen]
        try:
            labelled = [frame for frame in frames if frame.has("label_2") and frame.has("calib")]
            if not any(is_tilted(frame.calibration) for frame in labelled):
                return "camera", ""
            return infer_label_axes((frame.labels.cared_for, frame.calibration, frame.points) for frame in labelled)
        except CosimError:
            return "camera", ""  # the reader of the frame reports the error

    @property
    def lidars(self) -> tuple[str, ...]:
        """Names of the additional LiDARs; `of_lidar` opens their drives. Empty for the drive of such a LiDAR."""
        folder = self.base / LIDARS
        if self.lidar or not folder.is_dir():
            return ()
        return tuple(sorted(item.name for item in folder.iterdir() if (item / "velodyne").is_dir()))

    def of_lidar(self, name: str) -> Drive:
        """The drive as another of its LiDARs saw it.

        Raises:
            DriveError: there is no such LiDAR.
        """
        return Drive(lidar_folder(self.base, name))

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of the lists in `ImageSets/`, such as `train` and `val`."""
        if self._image_sets is None:
            return ()
        return tuple(sorted(file.stem for file in self._image_sets.glob("*.txt")))

    def split(self, name: str) -> tuple[str, ...]:
        """Names of the frames of a list in `ImageSets/`, in its order; those that are not here left out.

        Raises:
            DriveError: no such list, a line is not a plain name, or none of its frames is here.
        """
        if self._image_sets is None or not is_safe_name(name) or name not in self.splits:
            lists = ", ".join(self.splits) or "none"
            raise DriveError(f"{self.root}: no ImageSets/{name}.txt; lists there: {lists}")
        listed = read_split(self._image_sets / f"{name}.txt")
        here = tuple(frame for frame in listed if frame in self)
        if not here:
            raise DriveError(f"{self._image_sets / name}.txt: none of its {len(listed)} frames is in {self.root}")
        if len(here) < len(listed):
            _LOG.warning("%s: %d of %d frames are not here", name, len(listed) - len(here), len(listed))
        return here

    @property
    def pattern(self) -> str | None:
        """The beam pattern: path of `pattern.yaml`, else the name or path in `drive.yaml`; None if unsaid."""
        own = self.root / "pattern.yaml"
        if own.is_file():
            return str(own)
        named = self.info.get("pattern")
        if named is None:
            return None
        local = self.root / str(named)
        return str(local) if local.is_file() else str(named)

    @property
    def sensor_path(self) -> Path | None:
        """`sensor.yaml`, if there is one."""
        return self._file("sensor.yaml")

    @property
    def materials_path(self) -> Path | None:
        """`twin/materials.yaml`, if there is one."""
        path = self.base / "twin/materials.yaml"
        return path if path.is_file() else None

    @property
    def model_names(self) -> tuple[str, ...]:
        """Names of the models in `twin/models/`."""
        return tuple(sorted(file.stem for file in (self.base / "twin/models").glob("*.glb")))

    def model_path(self, name: str) -> Path:
        """The glTF file of a model.

        Raises:
            DriveError: there is none of that name.
        """
        file = self.base / "twin/models" / f"{name}.glb"
        if not is_safe_name(name) or not file.is_file():
            raise DriveError(f"{self.root}: no twin/models/{name}.glb; add the model, or change the frames that use it")
        return file

    @cached_property
    def missing(self) -> tuple[str, ...]:
        """Missing parts and their consequences, one sentence each; empty for a complete drive."""
        absences = [self._absence(part, then) for part, then in _CONSEQUENCES.items() if self._expects(part)]
        if not any((self.base / "twin" / position).exists() for position in ("static.glb", "static", "worlds")):
            absences.append("twin/static.glb is absent: no static world")
        if self.pattern is None:
            absences.append("the beam pattern is not given: name one, or it is taken to be KITTI's")
        if "sweep_s" not in self.info and self._pattern_content.get("sweep_s") is None:
            absences.append(f"sweep_s is not given: taken to be {_SWEEP_S} s")
        if self.kind == "simulated":
            absences.append(self._absence("hits", "variants must trace again"))
            absences.append("" if self.sensor_path else "sensor.yaml is absent: the sensor is not known")
            absences.append("" if self.info else "drive.yaml is absent: the run is unfinished")
        if self._lost:
            absences.append(f"{self._lost} frames that manifest.jsonl lists have no scan: left out")
        return tuple(filter(None, absences))

    def notes(self, names: Iterable[str] | None = None) -> tuple[str, ...]:
        """Notes on missing parts and on scans with problems, a sentence each, for commands to print.

        Reads the scans.

        Args:
            names: of the frames; all by default.

        Raises:
            DriveError: none of them holds a point, or there is no such frame.
            FormatError: a scan cannot be read.
        """
        inferred = () if self.point_format.schema is None else self.point_format.schema.notes
        return (
            *self.missing,
            *inferred,
            *filter(None, [self.label_axes[1]]),
            *_scan_notes([self[name] for name in (self.frames if names is None else names)]),
        )

    @property
    def _reference(self) -> str:
        """Name of the camera that labels refer to, where the rig is not KITTI's."""
        name = self.info.get("label_camera", "")
        if not isinstance(name, str) or (name and not is_safe_name(name)):
            raise DriveError(f"{self.base / 'drive.yaml'}: label_camera is {name!r}; give a camera's name")
        return name

    def _expects(self, part: str) -> bool:
        """Whether to mention KITTI's camera 0: custom rigs have none."""
        return not (self._reference and part.endswith("_0"))

    def _said(self) -> Mapping[str, Any]:
        """Contents of `drive.yaml`; for additional LiDARs without the keys of the first one."""
        info = self._content(self.base / "drive.yaml")
        return {key: info[key] for key in info if key not in _OF_FIRST} if self.lidar else info

    def _absence(self, part: str, consequence: str) -> str:
        absent = sum(not frame.has(part) for frame in self)
        if not absent:
            return ""
        where = "is absent" if absent == len(self) else f"is absent for {absent} of {len(self)} frames"
        return f"{part}/ {where}: {consequence}"

    def _find_kind(self) -> Literal["simulated", "measured"]:
        kind = self.info.get("kind")
        if kind is None:
            unfinished = (self.base / "manifest.jsonl").is_file() or (self.root / "hits").is_dir()
            return "simulated" if unfinished else "measured"
        if kind not in ("simulated", "measured"):
            raise DriveError(f"{self.root / 'drive.yaml'}: kind is {kind!r}; write simulated or measured")
        return kind

    def _find_sweep(self) -> float:
        sweep = self.info.get("sweep_s", self._pattern_content.get("sweep_s", _SWEEP_S))
        if isinstance(sweep, bool) or not isinstance(sweep, int | float) or not 0 < sweep < 100:
            raise DriveError(f"{self.root}: sweep_s is {sweep!r}; give seconds a turn, as 0.1 (drive or pattern.yaml)")
        return float(sweep)

    @cached_property
    def point_format(self) -> PointFormat:
        """Layout of the scans and meaning of their columns; inferred from some of them where the drive is measured.

        Raises:
            FormatError: no layout fits, or two clues contradict each other.
        """
        if self.kind == "simulated":
            return PLAIN
        files = [self._scans / f"{name}.bin" for name in self.frames]
        return find_point_format(files, self.info, self.base / "drive.yaml")

    @cached_property
    def _pattern_content(self) -> Mapping[str, Any]:
        pattern = self.pattern
        return self._content(Path(pattern)) if pattern is not None else {}

    @cached_property
    def _elevations_rad(self) -> np.ndarray | None:
        degrees = self._pattern_content.get("elevation_deg")
        if degrees is None:
            return None
        try:
            return np.radians(np.array(degrees, np.float64).reshape(-1))
        except (TypeError, ValueError):
            raise DriveError(f"{self.pattern}: elevation_deg is not a list of numbers, one a laser") from None

    @staticmethod
    def _content(file: Path) -> Mapping[str, Any]:
        return read_mapping(file) if file.is_file() else {}

    def _file(self, name: str) -> Path | None:
        return self.root / name if (self.root / name).is_file() else None


def _scan_notes(frames: Sequence[Frame]) -> tuple[str, ...]:
    """Sentences on broken points, empty scans, intensities and rings; frames are read one after another.

    Raises:
        DriveError: no frame holds a point.
        FormatError: a scan cannot be read.
    """
    if not frames:
        raise DriveError("no frames: name at least one")
    left_out: Counter[str] = Counter()
    points = empty = dark = unordered = 0
    highest = 0.0
    for kept in frames:
        frame = replace(kept)  # forgets its points
        left_out.update(frame.left_out)
        points += len(frame.points)
        if not len(frame.points):
            empty += 1
            continue
        dark += not frame.has_intensity
        highest = max(highest, float(np.abs(frame.points[:, 3]).max()))
        unordered += not _has_rings(frame)
    if not points:
        raise DriveError(
            f"{frames[0].root}: none of the {len(frames)} scans holds a finite point; "
            "velodyne/NAME.bin is float32 x y z intensity a point"
        )
    many = len(frames)
    notes = {
        f"{left_out['not finite']} points hold NaN or infinity: left out": left_out.pop("not finite", 0),
        f"{left_out.total()} points are no returns ({', '.join(left_out)}): left out": left_out.total(),
        f"{empty} of {many} scans hold no point": empty,
        f"intensities are absent or all zero in {dark} of {many} scans: nothing is said of intensity there": dark,
        f"intensities reach {highest:g}: 0 to 1 is expected, those above count as 1": highest > 1,
        f"rings of {unordered} of {many} scans cannot be recovered, their points are in another order: "
        "give rays/NAME.npz": unordered,
    }
    return tuple(note for note, count in notes.items() if count)


def _has_rings(frame: Frame) -> bool:
    try:
        return len(frame.rays) == len(frame.points)
    except FormatError:
        return False

"""One pass over a set: objects into a table, points into histograms. Scans are read and forgotten one by one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from cosim.drives.kitti import Calibration, Frame, Labels, points_in_boxes
from cosim.drives.kitti.labels import DONT_CARE, NOT_GIVEN, truncation_doubt
from cosim.errors import FormatError
from cosim.stats.frame_set import FrameSet
from cosim.stats.objects import LabelledObjects
from sensors.cameras.kitti_rig import KITTI_CALIBRATION

FOCUS = "Car"
INTENSITY_STEP = 0.01  # KITTI stores reflectance on this grid
INTENSITIES = np.arange(101) * INTENSITY_STEP
RANGE_STEP_M = 1.0
RANGES_M = (np.arange(125) + 0.5) * RANGE_STEP_M
REACH_STEP_M = 4.0
REACHES_M = (np.arange(25) + 0.5) * REACH_STEP_M
_RINGS = 256
_CLEARANCE_M = 0.2  # of a box's bottom: what lies below is road


@dataclass(frozen=True, eq=False)
class Scans:
    """Statistics of the points of f frames; 0 for frames without a scan.

    Attributes:
        points: (f,) int64 points a frame.
        rings: (f,) int64 number of rings with returns; 0 if unknown.
        intensity, car_intensity: (f, 101) int64 points by intensity rounded to 0.01, of all and of those in boxes of
            cars, 0.2 m or more above the bottom.
        range_m: (f, 125) int64 points by distance from the sensor, in metres.
        reach_count, reach_sum, reach_zero: (25,) float64 by 4 m of distance: points, sum of intensity, zeros.
        ring_points: (256,) int64 points by ring.
    """

    points: np.ndarray
    rings: np.ndarray
    intensity: np.ndarray
    car_intensity: np.ndarray
    range_m: np.ndarray
    reach_count: np.ndarray
    reach_sum: np.ndarray
    reach_zero: np.ndarray
    ring_points: np.ndarray

    @classmethod
    def empty(cls, frames: int) -> Scans:
        """Nothing counted yet."""
        return cls(
            points=np.zeros(frames, np.int64),
            rings=np.zeros(frames, np.int64),
            intensity=np.zeros((frames, len(INTENSITIES)), np.int64),
            car_intensity=np.zeros((frames, len(INTENSITIES)), np.int64),
            range_m=np.zeros((frames, len(RANGES_M)), np.int64),
            reach_count=np.zeros(len(REACHES_M)),
            reach_sum=np.zeros(len(REACHES_M)),
            reach_zero=np.zeros(len(REACHES_M)),
            ring_points=np.zeros(_RINGS, np.int64),
        )


@dataclass(frozen=True, eq=False)
class Collected:
    """Statistics of a set after one pass over its frames.

    Attributes:
        title, kind, path: of the set.
        frames: names.
        labelled: (f,) bool, which frames have labels.
        scanned: (f,) bool, which have a scan.
        objects: labelled objects.
        classes: objects by class, `DontCare` regions included.
        scans: counts of points.
        notes: what is absent.
    """

    title: str
    kind: str
    path: str
    frames: tuple[str, ...]
    labelled: np.ndarray
    scanned: np.ndarray
    objects: LabelledObjects
    classes: Counter[str]
    scans: Scans
    notes: tuple[str, ...] = ()

    @property
    def focus(self) -> LabelledObjects:
        """The labelled cars."""
        return self.objects.of_type(FOCUS)

    @property
    def focus_per_frame(self) -> np.ndarray:
        """(labelled frames,) int64 cars in each."""
        return np.bincount(self.focus.frame, minlength=len(self.frames))[self.labelled]


def collect(source: FrameSet, on_frame: Callable[[str], None] = lambda name: None) -> Collected:
    """Read a set once, front to back.

    Args:
        source: the set.
        on_frame: called with the name of each frame before it is read.

    Raises:
        CosimError: a label, calibration or scan is broken.
    """
    tally = _Tally(len(source))
    for row, frame in enumerate(source):
        on_frame(frame.name)
        tally.add(row, frame)
    objects = LabelledObjects.merge(tally.tables)
    doubt = truncation_doubt(objects.truncated, objects.bbox)
    if doubt:
        objects = replace(objects, truncated=np.full(len(objects), NOT_GIVEN))
    return Collected(
        title=source.title,
        kind=source.kind,
        path=str(source.root),
        frames=source.names,
        labelled=tally.labelled,
        scanned=tally.scanned,
        objects=objects,
        classes=tally.classes,
        scans=tally.scans,
        notes=(*source.notes, *tally.notes, *([doubt] if doubt else [])),
    )


@dataclass(eq=False)
class _Tally:
    """Counts so far."""

    frames: int
    tables: list[LabelledObjects] = field(default_factory=list)
    classes: Counter[str] = field(default_factory=Counter)
    unordered: int = 0
    bright: int = 0

    def __post_init__(self) -> None:
        self.scans = Scans.empty(self.frames)
        self.labelled, self.scanned = np.zeros(self.frames, bool), np.zeros(self.frames, bool)

    def add(self, row: int, frame: Frame) -> None:
        """Count one frame."""
        labels = frame.labels if frame.has("label_2") else None
        points = frame.points if frame.has("velodyne") else None
        calibration = frame.calibration if frame.has("calib") else Calibration(**vars(KITTI_CALIBRATION))
        self.labelled[row], self.scanned[row] = labels is not None, points is not None
        if points is not None:
            self._add_points(row, points)
            self._add_rings(row, frame)
        if labels is not None:
            self.classes.update(labels.type)
            self._add_objects(row, labels.cared_for, calibration, points)

    @property
    def notes(self) -> list[str]:
        """Notes about what could not be counted."""
        notes = []
        if self.unordered:
            notes.append(f"rings of {self.unordered} scans are unknown: no rays/, and not stored ring by ring")
        if self.bright:
            notes.append(f"{self.bright:,} points have an intensity outside 0–1: counted at the nearer end")
        if self.labelled.any() and not self.classes.keys() - {DONT_CARE}:
            notes.append("no frame has a labelled object")
        return notes

    def _add_points(self, row: int, points: np.ndarray) -> None:
        scans = self.scans
        distance = np.sqrt(np.einsum("ij,ij->i", points[:, :3], points[:, :3]))
        step = _steps(points[:, 3])
        self.bright += int(((points[:, 3] > 1 + INTENSITY_STEP / 2) | (points[:, 3] < -INTENSITY_STEP / 2)).sum())
        scans.points[row] = len(points)
        scans.intensity[row] = np.bincount(step, minlength=101)
        metres = np.minimum((distance / RANGE_STEP_M).astype(np.int64), len(RANGES_M) - 1)
        scans.range_m[row] = np.bincount(metres, minlength=len(RANGES_M))
        reach = np.minimum((distance / REACH_STEP_M).astype(np.int64), len(REACHES_M) - 1)
        scans.reach_count[:] += np.bincount(reach, minlength=len(REACHES_M))
        scans.reach_sum[:] += np.bincount(reach, points[:, 3], len(REACHES_M))
        scans.reach_zero[:] += np.bincount(reach, step == 0, len(REACHES_M))

    def _add_rings(self, row: int, frame: Frame) -> None:
        try:
            rings = np.bincount(frame.rays.ring, minlength=_RINGS)
        except FormatError:
            if frame.has("rays"):
                raise
            self.unordered += 1
            return
        self.scans.rings[row] = np.count_nonzero(rings)
        self.scans.ring_points[:] += rings

    def _add_objects(self, row: int, labels: Labels, calibration: Calibration, points: np.ndarray | None) -> None:
        if not len(labels):
            return
        if points is None:
            self.tables.append(LabelledObjects.of(labels, calibration, row, None))
            return
        boxes = labels.boxes_velo(calibration)
        inside = points_in_boxes(points, boxes)
        self.tables.append(LabelledObjects.of(labels, calibration, row, inside.sum(1)))
        for box in np.flatnonzero([name.lower() == FOCUS.lower() for name in labels.type]):
            body = points[inside[box]]
            floor = boxes.centre[box, 2] - boxes.size[box, 2] / 2 + _CLEARANCE_M
            self.scans.car_intensity[row] += np.bincount(_steps(body[body[:, 2] > floor, 3]), minlength=101)


def _steps(intensity: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(intensity / INTENSITY_STEP), 0, 100).astype(np.int64)

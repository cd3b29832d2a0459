"""The one or two drives that a page shows: pairs of frames, and the sensor models for residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cosim.drives.kitti import Drive
from cosim.errors import DriveError
from cosim.view.camera_images import camera_parts
from cosim.view.colours import CLASS_COLOURS, OTHER_CLASS
from cosim.view.frame_pictures import intensity_scale
from cosim.view.interactive.record import FrameRecords
from cosim.view.interactive.residual import ResidualTracer
from cosim.view.selection import spread_evenly
from cosim.view.titles import drive_title
from sensors.pattern import load_pattern
from sensors.sensor_model import SensorModel, load_sensor

MOST_IN_A_FILE = 200
_SCALED_FRAMES = 6
_MOST_CAMERAS = 32
_DEFAULT_PATTERN = "hdl64e_kitti"  # measured drives without a pattern are assumed to be KITTI's


@dataclass(frozen=True, eq=False)
class ShownDrives:
    """Content of a page.

    Attributes:
        records: frame records of each drive.
        steps: frames of each step of the slider, one per drive.
        notes: notes on the selection, one sentence each.
    """

    records: tuple[FrameRecords, ...]
    steps: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]

    def settings(self, *, served: bool) -> dict[str, Any]:
        """Settings of the page's script, as JSON values."""
        drives = [records.drive for records in self.records]
        tops = [intensity_scale(drive, self._scaled(row)).high for row, drive in enumerate(drives)]
        cameras = [len(camera_parts(drive[self.steps[0][row]])) for row, drive in enumerate(drives)]
        return {
            "served": served,
            "drives": [drive_title(drive) for drive in drives],
            "steps": self.steps,
            "intensity_top": max(tops),
            "cameras": max(cameras) if served else 1,
            "classes": CLASS_COLOURS,
            "other_class": OTHER_CLASS,
        }

    def absences(self) -> list[tuple[str, tuple[str, ...]]]:
        """Title and missing parts of each drive."""
        return [(drive_title(records.drive), records.drive.missing) for records in self.records]

    def _scaled(self, row: int) -> tuple[str, ...]:
        return spread_evenly(tuple(step[row] for step in self.steps), _SCALED_FRAMES)


def show_drives(
    drives: Sequence[Drive], wanted: str | None, most: int | None, sensor: str | None, *, for_file: bool
) -> ShownDrives:
    """Select the frames to show, and the sensor models for residuals.

    The frames of two drives are paired by name if one drive contains all names of the other, else by order.

    Args:
        drives: one or two drives.
        wanted: comma-separated frame names of the first drive, or a number of evenly spaced frames; None for all.
        most: maximum number of frames if `wanted` is None.
        sensor: file or name of the sensor model for residuals; by default each drive's own sensor, or its pattern
            without effects.
        for_file: True: strong compression and one image per frame; False: fast compression and all images.

    Raises:
        CosimError: a frame does not exist, there are too many for a file, there is a sensor but no twin, or a drive is
            damaged.
        SensorError: the sensor file is invalid.
    """
    notes: list[str] = []
    steps = _pair_frames(drives, notes)
    steps = _select_steps(steps, drives[0], wanted, most)
    if for_file and len(steps) > MOST_IN_A_FILE:
        raise DriveError(
            f"--frames selects {len(steps)} frames; a file holds at most {MOST_IN_A_FILE}: show all with --serve"
        )
    records = []
    for drive in drives:
        tracer, why_not = _tracer(drive, steps[0][len(records)], sensor)
        records.append(
            FrameRecords(drive, tracer, why_not, most_cameras=1 if for_file else _MOST_CAMERAS, thorough=for_file)
        )
    if sensor is not None and not any(drive_records.traces for drive_records in records):
        raise DriveError(f"--sensor needs a twin to trace, and {drives[0].root} has none; leave it out, or make one")
    return ShownDrives(tuple(records), steps, tuple(notes))


def _pair_frames(drives: Sequence[Drive], notes: list[str]) -> tuple[tuple[str, ...], ...]:
    if len(drives) == 1:
        return tuple((name,) for name in drives[0].frames)
    first, second = drives
    shared = tuple((name, name) for name in first.frames if name in second)
    if len(shared) == min(len(first), len(second)):
        return shared
    notes.append("the frames of the drives have different names: they are paired by their order")
    return tuple(zip(first.frames, second.frames, strict=False))


def _select_steps(
    steps: tuple[tuple[str, ...], ...], drive: Drive, wanted: str | None, most: int | None
) -> tuple[tuple[str, ...], ...]:
    if wanted is None:
        return steps if most is None else _spread(steps, most)
    names = tuple(dict.fromkeys(name.strip() for name in wanted.split(",") if name.strip()))
    by_name = {step[0]: step for step in steps}
    if len(names) == 1 and names[0] not in by_name and names[0].isdecimal() and not names[0].startswith("0"):
        return _spread(steps, int(names[0]))
    if not names:
        raise DriveError(f"--frames is {wanted!r}; give names separated by commas, or a number above 0")
    for name in names:
        drive[name]
        if name not in by_name:
            raise DriveError(f"--frames names {name}, which is not in the other drive; name frames of both drives")
    return tuple(by_name[name] for name in names)


def _spread(steps: tuple[tuple[str, ...], ...], count: int) -> tuple[tuple[str, ...], ...]:
    kept = set(spread_evenly(tuple(step[0] for step in steps), count))
    return tuple(step for step in steps if step[0] in kept)


def _tracer(drive: Drive, name: str, sensor: str | None) -> tuple[ResidualTracer | None, str]:
    if not drive[name].has("twin/frames"):
        return None, "there is no twin to trace; `cosim twin` makes one from labels"
    if sensor is not None:
        return ResidualTracer(drive, load_sensor(sensor)), ""
    own = drive.sensor_path
    if own is not None:
        return ResidualTracer(drive, load_sensor(str(own))), ""
    pattern = load_pattern(drive.pattern or _DEFAULT_PATTERN)
    return ResidualTracer(drive, SensorModel(pattern, (), f"the bare pattern {pattern.name}")), ""

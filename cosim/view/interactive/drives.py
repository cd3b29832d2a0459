"""The one or two drives that a page shows: which frames go together, and what may be told of their points."""

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
_BARE = "hdl64e_kitti"  # measured drives that name no pattern are KITTI's


@dataclass(frozen=True, eq=False)
class ShownDrives:
    """What a page shows.

    Attributes:
        records: of each drive.
        steps: the frames of each step of the slider, one of every drive.
        notes: what should be said about them, a sentence each.
    """

    records: tuple[FrameRecords, ...]
    steps: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...]

    def settings(self, *, served: bool) -> dict[str, Any]:
        """What the page's script must know before any frame, as JSON values."""
        drives = [one.drive for one in self.records]
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
        """Title and what is missing, of each drive."""
        return [(drive_title(one.drive), one.drive.missing) for one in self.records]

    def _scaled(self, row: int) -> tuple[str, ...]:
        return spread_evenly(tuple(step[row] for step in self.steps), _SCALED_FRAMES)


def show_drives(
    drives: Sequence[Drive], wanted: str | None, most: int | None, sensor: str | None, *, for_file: bool
) -> ShownDrives:
    """Choose frames, and find out what can be traced.

    Two drives go together by the names of their frames if one holds all names of the other, else by their order.

    Args:
        drives: one or two.
        wanted: names of frames of the first drive with commas between, or how many, evenly spread; None for all.
        most: how many at most if `wanted` is None.
        sensor: file or name of the sensor model whose residuals are shown; by default each drive's own, or the bare
            pattern where a drive has a twin but no sensor.
        for_file: whether frames are packed tightly with one image each, rather than quickly with all.

    Raises:
        CosimError: no such frame, too many for a file, a sensor but no twin, or a broken drive.
        SensorError: the sensor file breaks the rules.
    """
    notes: list[str] = []
    steps = _paired(drives, notes)
    steps = _chosen(steps, drives[0], wanted, most)
    if for_file and len(steps) > MOST_IN_A_FILE:
        raise DriveError(
            f"--frames takes {len(steps)} frames; a file holds at most {MOST_IN_A_FILE}: --serve shows all"
        )
    records = []
    for drive in drives:
        tracer, why_not = _tracer(drive, steps[0][len(records)], sensor)
        records.append(
            FrameRecords(drive, tracer, why_not, most_cameras=1 if for_file else _MOST_CAMERAS, thorough=for_file)
        )
    if sensor is not None and not any(one.traces for one in records):
        raise DriveError(f"--sensor needs a twin to trace, and {drives[0].root} has none; leave it out, or make one")
    return ShownDrives(tuple(records), steps, tuple(notes))


def _paired(drives: Sequence[Drive], notes: list[str]) -> tuple[tuple[str, ...], ...]:
    if len(drives) == 1:
        return tuple((name,) for name in drives[0].frames)
    one, other = drives
    shared = tuple((name, name) for name in one.frames if name in other)
    if len(shared) == min(len(one), len(other)):
        return shared
    notes.append("the drives do not hold frames of the same names: they go together by their order")
    return tuple(zip(one.frames, other.frames, strict=False))


def _chosen(
    steps: tuple[tuple[str, ...], ...], drive: Drive, wanted: str | None, most: int | None
) -> tuple[tuple[str, ...], ...]:
    if wanted is None:
        return steps if most is None else _spread(steps, most)
    names = tuple(dict.fromkeys(name.strip() for name in wanted.split(",") if name.strip()))
    by_name = {step[0]: step for step in steps}
    if len(names) == 1 and names[0] not in by_name and names[0].isdecimal() and not names[0].startswith("0"):
        return _spread(steps, int(names[0]))
    if not names:
        raise DriveError(f"--frames is {wanted!r}; give names with commas between, or a number above 0")
    for name in names:
        drive[name]
        if name not in by_name:
            raise DriveError(f"--frames names {name}, which the other drive lacks; name frames that both have")
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
    pattern = load_pattern(drive.pattern or _BARE)
    return ResidualTracer(drive, SensorModel(pattern, (), f"the bare pattern {pattern.name}")), ""

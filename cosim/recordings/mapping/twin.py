"""A recording as a drive with a twin, and what cannot be determined."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cosim.discrepancy.data.split import split_of_maps
from cosim.drives.writer import OutputError
from cosim.engine import Engine
from cosim.recordings.mapping.build import build_map
from cosim.recordings.mapping.correction import Correction
from cosim.recordings.mapping.doubts import frames_of, notes_of
from cosim.recordings.mapping.drive_files import DriveFiles
from cosim.recordings.mapping.kept import Arrays, Kept, arrays_of_map
from cosim.recordings.mapping.odometry import Trajectory
from cosim.recordings.mapping.prepare import Prepared, about, prepare, report_step
from cosim.recordings.mapping.segments import Segment
from cosim.recordings.mapping.sweep import SweepEstimate
from cosim.recordings.mapping.whole import WholeMap, whole_map
from cosim.recordings.pattern.find import FoundPattern
from cosim.recordings.recording import Recording
from sensors.effects.base import Effect
from sensors.effects.registry import effect_classes
from sensors.pattern import Pattern


@dataclass(frozen=True, eq=False)
class RecordingTwin:
    """Twin of a recording.

    Attributes:
        folder: the drive.
        recording: what it was made of.
        names: of its scans as frames, in order.
        pattern: pattern that beams were assigned with.
        found: what the points show of the pattern.
        path: before the map refined it.
        made: the map.
        sweep: strength of the sensor's motion in a sweep in the points; None if the sensor does not move.
        notes: what is missing, uncertain or cannot be determined, a sentence each.
    """

    folder: Path
    recording: Path
    names: tuple[str, ...]
    pattern: Pattern
    found: FoundPattern
    path: Trajectory
    made: WholeMap
    sweep: SweepEstimate | None
    notes: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        made, sweep, held, fitted = self.made, self.sweep, list(self.made.held_out), list(self.made.fitted)
        return {
            "out": str(self.folder),
            "scans": len(self.names),
            "segments": len(made.segments),
            "poses": self.path.source,
            "path_m": round(self.path.path_m, 3),
            "lasers": len(self.found.lasers),
            "surfels": len(made),
            "surfels_ground": int(made.ground.sum()),
            "surfels_trusted": int(made.trusted.sum()),
            "surfels_moving": len(made.left_out),
            "cells_without_plane": made.no_plane,
            "thickness_ground_m": round(_middle(made.sd_m[made.ground]), 5),
            "thickness_walls_m": round(_middle(made.sd_m[~made.level]), 5),
            "sweep_strength": sweep and round(sweep.strength, 3),
            "sweep_strength_ci95": sweep and [round(sweep.low, 3), round(sweep.high, 3)],
            "motion_compensated": sweep and sweep.is_compensated,
            "thickness_by_sweep_scale_m": {
                f"{scale:g}": round(value, 5) for scale, value in (sweep.thickness_m if sweep else {}).items()
            },
            "held_out": [self.names[number] for number in held],
            "error_fitted_m": round(_middle(made.error_m[fitted]), 5),
            "error_held_out_m": round(_middle(made.error_m[held]), 5) if held else None,
            "points_on_map_share": round(float(np.median(made.on_map)), 4),
            "mount": {
                "height_m": round(float(np.median(made.pose_ego[made.mapped, 2, 3])), 4),
                "from_ground": made.mount_known,
            },
            "notes": list(self.notes),
        }


def write_recording_twin(
    recording: Recording,
    folder: Path,
    pattern: str | None = None,
    *,
    engine: Engine | None = None,
    on_step: Callable[[str], None] = lambda words: None,
) -> RecordingTwin:
    """Make a drive with a twin of a recording; segments and frames that an interrupted run left are kept.

    Args:
        recording: scans in order.
        folder: folder of the new drive; segments are kept next to it until it is finished.
        pattern: name or path of the beam pattern; found in the points by default.
        engine: whose processes share segments; by default this process does all.
        on_step: called with a description of each step before it starts.

    Raises:
        RecordingError: fewer than five scans, no map in them, or another pattern than the given.
        OutputError: the folder cannot be used.
        SensorError: no such pattern.
    """
    if folder.resolve() == recording.path.resolve():
        raise OutputError(f"{folder} is the recording itself; choose another --out")
    kept = folder.with_name(f"{folder.name}-segments")
    prepared = prepare(recording, kept, pattern, engine=engine, on_step=on_step)
    twin = write_map_twin(prepared, folder, kept, engine=engine, on_step=on_step)
    shutil.rmtree(kept, ignore_errors=True)
    return twin


def write_map_twin(
    prepared: Prepared,
    folder: Path,
    kept: Path,
    effects: Sequence[Effect] = (),
    *,
    sampled: bool = False,
    engine: Engine | None = None,
    on_step: Callable[[str], None] = lambda words: None,
) -> RecordingTwin:
    """Make the map and write it with the scans as a drive.

    Args:
        prepared: the recording.
        folder: of the new drive.
        kept: folder of the maps of segments.
        effects: of the sensor, as far as they are known: the map is made of points with these undone. The drive's
            own points stay as they were measured.
        sampled: write only the scans that a diagnosis looks at.
        engine: whose processes share segments; by default this process does all.
        on_step: called with a description of each step before it starts.

    Raises:
        RecordingError: no map in the scans.
        OutputError: the folder cannot be used.
    """
    maps = _maps(prepared, kept, effects)
    maps.all_made(prepared.segments, engine, lambda done: on_step(report_step("map", done, prepared.segments)))
    whole, recording = whole_map(prepared.segments, prepared.paths, maps), prepared.recording
    names = tuple(f"{number:06d}" for number in range(len(recording)))
    fit, held = frames_of(prepared, whole, names)
    places = dict(zip(names, whole.poses[:, :3, 3], strict=True))
    split = split_of_maps(fit, held, places, prepared.pattern.rings * prepared.pattern.firings)
    looked = len({whole.segment_of[names.index(name)] for name in split.fit})
    twin = RecordingTwin(
        folder=folder,
        recording=recording.path,
        names=names,
        pattern=prepared.pattern,
        found=prepared.found,
        path=prepared.path,
        made=whole,
        sweep=prepared.sweep,
        notes=(*recording.notes, *prepared.found.notes, *notes_of(prepared, whole, looked)),
    )
    on_step("files")
    frames = (*split.fit, *split.test) if sampled else names
    DriveFiles(prepared, whole, maps, names).write(folder, frames, _flat(fit), _flat(held), twin.as_json())
    return twin


def _maps(prepared: Prepared, kept: Path, effects: Sequence[Effect]) -> Kept:
    """Files of the maps of segments, and the function that builds one."""
    known = tuple(one for one in effects if one.name in effect_classes())  # shapes of no known effect move no point
    correction = Correction(prepared.pattern, prepared.found.lasers.lines, prepared.ring_of, known)
    sweep_scale = correction.sweep_scale()
    scale = prepared.sweep_scale if sweep_scale is None else sweep_scale
    depends = about(prepared.recording, prepared.pattern.to_yaml(), [repr(one) for one in known], scale)
    return Kept(kept, "map", depends, partial(_map, correction, prepared.paths, scale, prepared.recording))


def _map(
    correction: Correction,
    paths: Sequence[Trajectory],
    sweep_scale: float,
    recording: Recording,
    segment: Segment,
    on_scan: Callable[[], object],
) -> Arrays:
    part = correction.of(recording.between(segment.first, segment.last))
    return arrays_of_map(
        partial(
            build_map,
            part,
            paths[segment.number],
            correction.pattern.sweep_s,
            mount=recording.settings.mount,
            sweep_scale=sweep_scale,
            on_scan=on_scan,
        )
    )


def _flat(lists: Sequence[Sequence[str]]) -> list[str]:
    return [name for names in lists for name in names]


def _middle(values: np.ndarray) -> float:
    good = values[np.isfinite(values)]
    return float(np.median(good)) if len(good) else float("nan")

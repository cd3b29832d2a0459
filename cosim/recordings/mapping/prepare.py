"""Inputs of a map besides the points of a recording: beams, path, motion in a sweep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from cosim.engine import Engine
from cosim.recordings.checks import check_survey, survey_scans
from cosim.recordings.mapping.kept import Arrays, Kept, arrays_of_path, digest, path_of
from cosim.recordings.mapping.odometry import Trajectory, find_trajectory
from cosim.recordings.mapping.path_checks import check_path, check_sweep
from cosim.recordings.mapping.segments import Segment, segments_of, together
from cosim.recordings.mapping.surfels import SurfelSettings
from cosim.recordings.mapping.sweep import SweepEstimate, sweep_motion
from cosim.recordings.pattern.find import FoundPattern, find_pattern
from cosim.recordings.recording import Recording
from cosim.recordings.scan import RecordingError
from sensors.pattern import Pattern, load_pattern

_SAME_LASER_DEG = 0.4  # between a laser of the given pattern and one that the points show
_FEWEST_SCANS = 5


@dataclass(frozen=True, eq=False)
class Prepared:
    """Inputs of a map besides the points of a recording.

    Attributes:
        recording: the recording.
        pattern: pattern that beams are assigned with.
        found: what the points show of the pattern.
        ring_of: (k,) ring of the pattern for each laser that the points show.
        segments: that are mapped each by itself.
        paths: of the sensor in each.
        sweep: strength of the sensor's motion in a sweep; None if the sensor does not move.
        notes: of the checks, a sentence each.
    """

    recording: Recording
    pattern: Pattern
    found: FoundPattern
    ring_of: np.ndarray
    segments: tuple[Segment, ...]
    paths: tuple[Trajectory, ...]
    sweep: SweepEstimate | None
    notes: tuple[str, ...] = ()

    @property
    def sweep_scale(self) -> float:
        """Share of its motion in a sweep that points are to be freed of: 0 or 1."""
        return 1.0 if self.sweep is None else self.sweep.scale

    @property
    def path(self) -> Trajectory:
        """Path of the sensor through the whole recording, in the axes of its first pose."""
        if len(self.paths) == 1:
            return self.paths[0]
        poses = together(self.segments, [path.poses for path in self.paths])
        pairs = list(zip(self.segments, self.paths, strict=True))
        motion = np.concatenate([path.motion[segment.own] for segment, path in pairs])
        doubtful = sorted({segment.first + row for segment, path in pairs for row in path.doubtful})
        turns = self.recording.turns(self.pattern.sweep_s)
        return replace(self.paths[0], poses=poses, motion=motion, doubtful=tuple(doubtful), turns=turns)


def prepare(
    recording: Recording,
    folder: Path,
    pattern: Pattern | str | None = None,
    *,
    engine: Engine | None = None,
    on_step: Callable[[str], None] = lambda words: None,
) -> Prepared:
    """Pattern, path and motion in a sweep of a recording.

    Args:
        recording: scans in order.
        folder: where the paths of segments are kept.
        pattern: the beam pattern, its name or its path; found in the points by default.
        engine: whose processes share segments; by default this process does all.
        on_step: called with a description of each step before it starts.

    Raises:
        RecordingError: fewer than five scans, no map in them, or another pattern than the given.
        SensorError: no such pattern.
    """
    if len(recording) < _FEWEST_SCANS:
        raise RecordingError(
            f"{recording.path}: {len(recording)} scans; a map needs five at least, and some dozens to be good"
        )
    on_step("pattern")
    found = find_pattern(recording, "recording")
    given = load_pattern(pattern) if isinstance(pattern, str) else pattern
    beams = given or found.pattern
    ring_of = _rings(found, beams, beams.name)
    on_step("checks of the scans")
    accepted = recording.settings.accept
    notes = check_survey(recording, survey_scans(recording, found.lasers.lines), accepted)
    segments = segments_of(len(recording), recording.settings.segment_scans)
    kept = Kept(folder, "path", about(recording, beams.sweep_s), partial(_path, recording, beams.sweep_s))
    kept.all_made(segments, engine, lambda done: on_step(report_step("odometry", done, segments)))
    paths = tuple(path_of(kept.read(segment)) for segment in segments)
    on_step("checks of the path")
    for segment, path in zip(segments, paths, strict=True):
        notes += check_path(recording.between(segment.first, segment.last), path, accepted)
    on_step("sweep motion")
    sweep = _sweep(recording, segments, paths, found.lasers.lines, beams.sweep_s)
    prepared = Prepared(recording, beams, found, ring_of, segments, paths, sweep)
    notes += check_sweep(recording, prepared.path, sweep, accepted)
    return replace(prepared, notes=tuple(dict.fromkeys(notes)))


def about(recording: Recording, *things: object) -> str:
    """A short name of a recording's scans and of what else something depends on."""
    return digest(
        str(recording.path.resolve()),
        recording.names,
        recording.settings.model_dump(exclude={"accept", "skip_damaged"}),
        *things,
    )


def report_step(what: str, done: int, segments: tuple[Segment, ...]) -> str:
    """Report progress."""
    return what if len(segments) == 1 else f"{what}: {done} of {len(segments)} segments"


def _path(recording: Recording, sweep_s: float, segment: Segment, on_scan: Callable[[], object]) -> Arrays:
    return arrays_of_path(find_trajectory(recording.between(segment.first, segment.last), sweep_s, on_scan))


def _sweep(
    recording: Recording,
    segments: tuple[Segment, ...],
    paths: tuple[Trajectory, ...],
    lines: np.ndarray,
    sweep_s: float,
) -> SweepEstimate | None:
    """For the segment with the longest path of the middle three; None if the sensor does not move there."""
    middle = (len(segments) - 1) // 2
    near = range(max(middle - 1, 0), min(middle + 2, len(segments)))
    number = max(near, key=lambda one: paths[one].extent_m)
    path, segment = paths[number], segments[number]
    if path.standing:
        return None
    part = recording.between(segment.first, segment.last)
    return sweep_motion(part, path, lines, sweep_s, SurfelSettings())


def _rings(pattern: FoundPattern, beams: Pattern, given: str) -> np.ndarray:
    """Ring of the pattern for each laser that the points show (k,).

    Raises:
        RecordingError: they are not the pattern's.
    """
    apart = np.abs(pattern.lasers.elevation_deg[:, None] - np.array(beams.elevation_deg))
    ring, off = apart.argmin(1), apart.min(1)
    if off.max() > _SAME_LASER_DEG or len(np.unique(ring)) < len(ring):
        row = int(off.argmax())
        raise RecordingError(
            f"pattern {given}: {beams.rings} lasers, none of them the one that points show at "
            f"{pattern.lasers.elevation_deg[row]:+.2f}° (of {len(pattern.lasers)}); omit --pattern, or give its own"
        )
    return ring

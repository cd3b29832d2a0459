"""Reliability of a map: scans that a diagnosis uses, and notes on what is uncertain or cannot be determined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.recordings.mapping.prepare import Prepared
from cosim.recordings.mapping.whole import WholeMap
from cosim.recordings.recording import Recording

_FEW_SCANS, _FEWEST_SURE = 20, 5
_LOST_SHARE = 0.5  # of the usual share of points on the map: below, a scan's pose is doubtful
_LEAST_HELD = 0.001  # in every direction; a bare tunnel holds a scan by some 0.0002 along it, streets by 0.01 or more
_FEW_TRUSTED = 0.2  # of the surfaces
_SHOWN = 8


def frames_of(prepared: Prepared, made: WholeMap, names: Sequence[str]) -> tuple[list[list[str]], list[list[str]]]:
    """Names of the scans used for maps and of those not used, a list for each segment.

    Segments without a map are excluded. If others remain, so are segments in which the sensor does not move (each
    surface is seen from one position), segments whose path jumps (surfaces are duplicated), and scans with uncertain
    poses.
    """
    used = made.mapped
    for bad in (_standing(prepared), _jumping(prepared)):
        used = used & ~bad if (used & ~bad).any() else used
    numbers = np.flatnonzero(used).tolist()
    doubtful = {*_slipping(prepared, made), *_lost(made)}
    sure = [one for one in made.fitted if one not in doubtful and used[made.segment_of[one]]]
    left_out = doubtful if len(sure) >= _FEWEST_SURE else set()

    def by_segment(scans: Sequence[int]) -> list[list[str]]:
        chosen = [one for one in scans if one not in left_out]
        return [[names[one] for one in chosen if made.segment_of[one] == number] for number in numbers]

    return by_segment(made.fitted), by_segment(made.held_out)


def _standing(prepared: Prepared) -> np.ndarray:
    """(k,) bool: segments in which the sensor stays where it is."""
    return np.array([path.standing for path in prepared.paths])


def _jumping(prepared: Prepared) -> np.ndarray:
    """(k,) bool: segments in which the path jumps."""
    return np.array([bool(path.doubtful) for path in prepared.paths])


def _slipping(prepared: Prepared, made: WholeMap) -> list[int]:
    """Numbers of the scans that odometry may have placed wrongly along what they see, without a trace in the map."""
    if not prepared.path.from_odometry:
        return []
    return np.flatnonzero((made.held < _LEAST_HELD) & made.mapped[made.segment_of]).tolist()


def _lost(made: WholeMap) -> list[int]:
    """Numbers of the scans of which much less than usual lies on the map."""
    mapped = made.mapped[made.segment_of]
    usual = float(np.median(made.on_map[mapped]))
    return np.flatnonzero((made.on_map < _LOST_SHARE * usual) & mapped).tolist()


def notes_of(prepared: Prepared, made: WholeMap, looked: int) -> list[str]:
    """Notes on what is missing, uncertain or cannot be determined, a sentence each."""
    path, recording = prepared.path, prepared.recording
    notes = [f"poses: {path.source}", *prepared.notes, *_segment_notes(prepared, made, looked)]
    slipping, lost = _slipping(prepared, made), _lost(made)
    if path.standing and len(slipping) < len(recording) / 2:
        notes.append(
            f"the sensor moves {path.extent_m:.2f} m in all, so each surface is seen from one position: sweep "
            "motion, and effects that depend only on range or angle, cannot be separated from the surfaces"
        )
    elif prepared.sweep is not None:
        notes.append(f"motion-compensated: {prepared.sweep.is_compensated}; {prepared.sweep.evidence}")
    if len(recording) < _FEW_SCANS:
        notes.append(
            f"{len(recording)} scans only: each surface is seen few times, so thickness and effects have wide intervals"
        )
    if path.doubtful:
        notes.append(
            f"the path jumps at {_counted(path.doubtful)} ({_named(recording, path.doubtful)}): odometry is uncertain "
            "there"
        )
    if slipping:
        notes.append(
            f"{_counted(slipping)} ({_named(recording, slipping)}): the motion in one direction is not observable, "
            "as in a tunnel or on an open plain: odometry may have drifted there, or found no motion; provide poses"
        )
    if lost:
        notes.append(
            f"{_counted(lost)} ({_named(recording, lost)}): few of the points lie on the map, because odometry "
            "failed or many objects move: poses are uncertain there"
        )
    if made.trusted.mean() < _FEW_TRUSTED:
        notes.append(
            f"{int(made.trusted.sum())} of {len(made)} surfaces are compared: the others were seen by a single "
            "laser (as by a stationary sensor), by few scans, or have many other points around them"
        )
    if not made.mount_known:
        notes.append("no ground was found: the sensor is assumed 1.8 m above it; recording.yaml may state mount:")
    notes.append(
        "range_scale and a constant offset along all normals cannot be determined: the map is made of these ranges"
    )
    notes.append("moving objects and regions without a plane are not in the twin; objects are not modelled")
    return notes


def _segment_notes(prepared: Prepared, made: WholeMap, looked: int) -> list[str]:
    """Note on a recording in several segments: how many, how many a diagnosis uses, and which are not usable."""
    if len(made.segments) == 1:
        return []
    notes = [f"{len(made.segments)} segments, a map each; a diagnosis looks at scans of {looked} of them"]
    blank = [one for one in made.segments if not made.mapped[one.number]]
    standing, jumping = _standing(prepared), _jumping(prepared)
    still = [one for one in made.segments if made.mapped[one.number] and standing[one.number]]
    torn = [
        one for one in made.segments if made.mapped[one.number] and jumping[one.number] and not standing[one.number]
    ]
    reasons = (
        (blank, "no map, as no surface is visible in three scans"), (still, "the sensor does not move"),
        (torn, "the path jumps, so that surfaces lie in two places"),
    )  # fmt: skip
    for subset, why in reasons:
        if subset and len(subset) < len(made.segments):
            shown = ", ".join(f"{one.begin}–{one.end - 1}" for one in subset[:_SHOWN])
            notes.append(f"left out of a diagnosis: {len(subset)} segments (scans {shown}): {why}")
    return notes


def _counted(numbers: Sequence[int]) -> str:
    return "1 scan" if len(numbers) == 1 else f"{len(numbers)} scans"


def _named(recording: Recording, numbers: Sequence[int]) -> str:
    """Names of some scans, runs of them by their ends."""
    runs = np.split(np.array(numbers), np.flatnonzero(np.diff(numbers) > 1) + 1)
    ranges = [recording.names[run[0]] + (f" to {recording.names[run[-1]]}" if len(run) > 1 else "") for run in runs]
    return ", ".join(ranges[:_SHOWN]) + (" …" if len(ranges) > _SHOWN else "")

"""Checks of scans before any pose is known: copies, several sensors, missing scans and intensities, dead lasers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.recordings.checks.survey import Survey
from cosim.recordings.folder import name_numbers
from cosim.recordings.recording import Recording
from cosim.recordings.scan import RecordingError

_OCCUPIED = 0.1  # share of the usual occupied bin's points that an occupied bin has
_OTHER_SENSOR = 0.35  # of the elevations that two scans have in common, at most, of different sensors
_SAME_SENSOR = 0.6  # at least, of one sensor
_DEAD_SHARE = 0.03  # of a laser's usual points, below which it is dead
_FEWEST_ALIVE = 3  # scans in which it was not
_PAIRED = 0.1  # share of the recording's scans that each of two sensors has, at least


def check_survey(recording: Recording, survey: Survey, accepted: Sequence[str] = ()) -> list[str]:
    """Check the scans of a recording; returns notes.

    Args:
        recording: scans in order.
        survey: of its scans.
        accepted: names of checks whose findings are notes.

    Raises:
        RecordingError: a check finds something that is not accepted.
    """
    findings = {
        "copies": _copies(recording, survey),
        "sensors": _sensors(recording, survey),
        "intensities": _intensities(recording, survey),
        "lasers": _lasers(recording, survey),
    }
    return [*raise_findings(recording, findings, accepted), *missing_scans(recording)]


def raise_findings(recording: Recording, findings: dict[str, str], accepted: Sequence[str]) -> list[str]:
    """Findings that are accepted, as notes.

    Raises:
        RecordingError: the first finding that is not accepted.
    """
    for name, words in findings.items():
        if words and name not in accepted:
            raise RecordingError(f"{recording.path}: {words}; or go on with --accept {name}")
    return [words for words in findings.values() if words]


def _copies(recording: Recording, survey: Survey) -> str:
    same = [row for row in range(1, len(survey.digest)) if survey.digest[row] == survey.digest[row - 1]]
    if not same:
        return ""
    first, second = recording.names[same[0] - 1], recording.names[same[0]]
    return (
        f"scans {first} and {second} hold the same points, and {len(same)} of {len(recording)} scans are copies of the "
        "one before: remove the copies, or choose scans with --scans"
    )


def _sensors(recording: Recording, survey: Survey) -> str:
    """Two groups of scans whose elevations have little in common, each uniform in itself."""
    used = np.flatnonzero(survey.points > 0)
    if len(used) < 4:
        return ""
    rows = used[np.unique(np.linspace(0, len(used) - 1, min(len(used), 60)).astype(int))]
    shares = survey.elevations[rows]
    usual = np.array([np.median(row[row > 0]) if (row > 0).any() else 1.0 for row in shares])
    is_there = shares > _OCCUPIED * usual[:, None]
    both = is_there.astype(np.int32) @ is_there.T.astype(np.int32)
    size = is_there.sum(1)
    common = both / np.maximum(np.minimum(size[:, None], size), 1)
    values, vectors = np.linalg.eigh(common - common.mean())
    group = vectors[:, np.abs(values).argmax()] > 0
    few = min(group.sum(), (~group).sum())
    if few < max(2, _PAIRED * len(rows)):
        return ""
    between = float(np.median(common[group][:, ~group]))
    within = min(float(np.median(common[np.ix_(side, side)])) for side in (group, ~group))
    if between > _OTHER_SENSOR or within < _SAME_SENSOR:
        return ""
    swaps = np.count_nonzero(np.diff(group.astype(int)))
    how = "in turn" if swaps > 0.5 * len(rows) else "one after the other"
    one, other = (recording.names[int(rows[np.argmax(side)])] for side in (group, ~group))
    return (
        f"two sensors {how}: scans such as {one} and {other} have {between:.0%} of their elevations in common, those "
        f"of each kind {within:.0%}; give the scans of one, as with --scans"
    )


def _intensities(recording: Recording, survey: Survey) -> str:
    lit = survey.has_intensity
    if lit.all() or not lit.any():
        return ""
    dark = np.flatnonzero(~lit)
    return (
        f"{len(dark)} of {len(lit)} scans hold no intensities ({recording.names[dark[0]]} the first); give scans that "
        "all have them, or leave the column out with --columns"
    )


def _lasers(recording: Recording, survey: Survey) -> str:
    """A laser that has points, and from some scan on has none."""
    shares, count = survey.by_laser, len(survey.by_laser)
    usual = np.quantile(shares, 0.9, axis=0)
    alive = shares > _DEAD_SHARE * usual
    for laser in np.flatnonzero(usual > 0):
        seen = np.flatnonzero(alive[:, laser])
        if len(seen) < _FEWEST_ALIVE:
            continue
        first, last = int(seen[0]), int(seen[-1])
        before, after = first, count - 1 - last
        quiet, where = (after, last + 1) if after >= before else (before, 0)
        steady = np.mean(alive[first : last + 1, laser])
        if quiet >= max(5, 0.2 * count) and steady > 0.9:
            side = f"from scan {recording.names[where]} on" if after >= before else f"before {recording.names[first]}"
            return (
                f"laser {laser + 1} of {shares.shape[1]} from the top returns nothing {side} ({quiet} of {count} "
                "scans): it is dead there, or covered; choose scans with --scans"
            )
    return ""


def missing_scans(recording: Recording) -> list[str]:
    """Notes on scans that are missing, by the numbers in names and by stamps."""
    notes = []
    numbers = name_numbers(recording.names)
    if numbers is not None:
        steps = np.diff(numbers)
        usual = int(steps.min())
        if usual > 1:
            notes.append(
                f"the numbers in names rise by {usual}: {usual - 1} of {usual} scans are missing throughout, and the "
                "sensor moves further between scans than in a sweep"
            )
        gaps = np.flatnonzero(steps > usual)
        if len(gaps):
            lost = int((steps[gaps] // usual - 1).sum())
            first, second = recording.names[gaps[0]], recording.names[gaps[0] + 1]
            notes.append(f"{lost} scans are missing by the numbers in names, the first between {first} and {second}")
    return notes

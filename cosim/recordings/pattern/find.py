"""Estimates a pattern file from the points of some scans, with the uncertainty of each part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.recordings.folder import name_numbers
from cosim.recordings.pattern.lasers import (
    NEAREST_M,
    Lasers,
    blur_rad,
    find_lasers,
    half_width_rad,
    nearest_laser,
    ring_lasers,
    rounding_m,
)
from cosim.recordings.pattern.turning import Turning, find_turning
from cosim.recordings.recording import Recording
from cosim.recordings.scan import RecordingError, Scan
from sensors.pattern import Pattern

SCANS = 12  # evenly spaced; more scans add little information
_LEAST_SHARE = 0.8  # of points on a beam: below, this is no spinning sensor in its own axes
_DOUBTFUL_SHARE = 0.97
_ODD_SHARE = 0.15  # a scan with this much less on the beams than the others is another sensor's
_FOREIGN = 0.5  # of a scan's points that are on lasers where others have none
_SECTORS, _LEAST_SECTORS = 72, 0.8
_USUAL_SWEEP_S = 0.1
_MISSING = 1.5  # times the span of points' times, from which the interval between scans holds further sweeps
_RING_MISFIT_DEG = 0.05
_BLOCKS_APART_M = 0.01
_FEWEST_POINTS = 200
_WEAK_LASER, _CLOSE_LASERS = 0.1, 0.2  # of the usual points of a laser, and of the usual distance of two


@dataclass(frozen=True, eq=False)
class FoundPattern:
    """A pattern and what it rests on.

    Attributes:
        pattern: for a sensor file.
        lasers: cones that points lie on.
        turning: how the head turns.
        scans: how many were looked at.
        points: in them.
        share_by_scan: (scans,) share of each scan's points on a beam.
        block_centre_m: heights of the optical centres of the blocks, the upper first; one or two.
        alternatives: other counts of lasers that the points allow; empty where the count is certain.
        notes: what could not be determined, a sentence each.
    """

    pattern: Pattern
    lasers: Lasers
    turning: Turning
    scans: int
    points: int
    share_by_scan: np.ndarray
    block_centre_m: tuple[float, ...]
    notes: tuple[str, ...]
    alternatives: tuple[int, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "lasers": len(self.lasers),
            "lasers_alternatives": list(self.alternatives),
            "elevation_deg": self.lasers.elevation_deg.round(4).tolist(),
            "elevation_sd_deg": self.lasers.elevation_sd_deg.round(5).tolist(),
            "misfit_deg": self.lasers.misfit_deg.round(5).tolist(),
            "centre_m": self.lasers.centre_m.round(4).tolist(),
            "block_centre_m": [round(value, 4) for value in self.block_centre_m],
            "points": self.points,
            "points_on_a_beam_share": round(self.lasers.share, 4),
            "scans": self.scans,
            "firings": self.turning.firings,
            "firings_sd": round(self.turning.firings_sd, 2),
            "firings_fixed": self.turning.fixed,
            "order": self.turning.order,
            "azimuth_offset_deg": list(self.pattern.azimuth_offset_deg),
            "azimuth_offset_known": self.turning.fan_known,
            "sweep_s": self.pattern.sweep_s,
            "notes": list(self.notes),
        }


def find_pattern(
    recording: Recording, name: str = "found", count: int = SCANS, on_scan: Callable[[], object] = lambda: None
) -> FoundPattern:
    """The beam pattern that the points of a recording were taken with.

    Args:
        recording: of one spinning sensor, in its own axes.
        name: of the pattern.
        count: scans to look at, evenly spread.
        on_scan: called after each is read.

    Raises:
        RecordingError: too few points, points of no spinning sensor, or scans of several sensors.
        FormatError: a scan cannot be read.
    """
    scans = []
    for number in np.unique(np.linspace(0, len(recording) - 1, min(count, len(recording))).round().astype(int)):
        scans.append(recording[int(number)])
        on_scan()
    scans = [scan for scan in scans if len(scan)]
    points = sum(len(scan) for scan in scans)
    if points < _FEWEST_POINTS:
        raise RecordingError(f"{recording.path}: {points} points in the scans looked at; a pattern needs thousands")
    lasers, how = _lasers(scans)
    which, shares = _assigned(scans, lasers)
    _demand_one_sensor(recording, scans, lasers, which, shares)
    sweep_s, sweep_note = _sweep(recording, scans)
    turning = find_turning(scans, which, len(lasers), sweep_s)
    blocks, centres = _blocks(lasers)
    notes = [*how, *_turn_notes(scans), *sweep_note, *_turning_notes(turning), *_laser_notes(lasers, centres)]
    reach = np.concatenate([np.linalg.norm(scan.xyz, axis=1) for scan in scans])
    pattern = Pattern(
        name=name,
        sweep_s=round(sweep_s, 6),
        firings=max(turning.firings, 1),
        range_m=(float(np.floor(10 * reach.min()) / 10), float(np.ceil(reach.max()))),
        elevation_deg=tuple(lasers.elevation_deg.round(4).tolist()),
        azimuth_offset_deg=tuple(turning.fan_deg.tolist()),
        block=tuple(blocks.tolist()),
    )
    others = _other_counts(scans, lasers)
    if others:
        words = " or ".join(map(str, others))
        notes.insert(0, f"{len(lasers)} lasers are not certain: the points allow {words}, too; give --pattern if known")
    return FoundPattern(pattern, lasers, turning, len(scans), points, shares, centres, tuple(notes), others)


def beams_of(scan: Scan, lines: np.ndarray) -> np.ndarray:
    """Row of the laser (lines (k, 2) as `Lasers.lines`) that each point of a scan comes from, (n,) int; −1 for none."""
    rho = scan.flat_range_m
    which, off = nearest_laser(rho, scan.xyz[:, 2], lines)
    blur = blur_rad(rounding_m(scan.xyz), rho, scan.xyz[:, 2])
    return np.where(np.abs(off) < half_width_rad(blur), which, -1)


def _lasers(scans: list[Scan]) -> tuple[Lasers, list[str]]:
    """Lasers from the points, or from the recording's own laser numbers if these give sharper cones."""
    rho = np.concatenate([scan.flat_range_m for scan in scans])
    height = np.concatenate([scan.xyz[:, 2] for scan in scans])
    number = np.repeat(np.arange(len(scans)), [len(scan) for scan in scans])
    rounding = min(rounding_m(scan.xyz) for scan in scans)
    found = find_lasers(rho, height, number, rounding)
    how = (
        [f"coordinates are multiples of {rounding:g} m, which blurs the elevations of near points"] if rounding else []
    )
    rings = [scan.ring for scan in scans if scan.ring is not None]
    if len(rings) < len(scans):
        return found, how
    ring = np.concatenate(rings)
    if ring.min() < 0 or ring.max() > 255:
        return found, [f"ring numbers run from {ring.min()} to {ring.max()}: not used"]
    numbered = ring_lasers(rho, height, number, ring, rounding)
    numbers = len(np.unique(ring))
    if not len(numbered) or np.median(numbered.misfit_deg) > _RING_MISFIT_DEG * max(
        1, 4 * (found.share < _LEAST_SHARE)
    ):
        return found, [
            f"the recording numbers {numbers} lasers, whose points lie on no cones: its numbers are not used"
        ]
    if len(numbered) == len(found) and found.share >= numbered.share - 0.01:
        return found, []
    message = f"the recording numbers {numbers} lasers; the points show {len(found)}: its numbers are used"
    return numbered, [message]


def _other_counts(scans: list[Scan], lasers: Lasers) -> tuple[int, ...]:
    """Other counts of lasers that the evidence allows.

    Without lasers that few points show, without lines much nearer to each other than is usual, and by the numbers in
    the recording.
    """
    counts, points = set[int](), lasers.points
    strong = points > _WEAK_LASER * np.median(points)
    counts.add(int(strong.sum()))
    gaps = -np.diff(lasers.elevation_deg[strong])
    if len(gaps) > 2:
        counts.add(int(1 + np.sum(gaps > _CLOSE_LASERS * np.median(gaps))))
    numbers = [scan.ring for scan in scans if scan.ring is not None]
    if len(numbers) == len(scans):
        counts.add(len(np.unique(np.concatenate(numbers))))
    return tuple(sorted(counts - {len(lasers), 0}))


def _assigned(scans: list[Scan], lasers: Lasers) -> tuple[list[np.ndarray], np.ndarray]:
    if not len(lasers):
        return [np.full(len(scan), -1) for scan in scans], np.zeros(len(scans))
    which = [beams_of(scan, lasers.lines) for scan in scans]
    return which, np.array([float(np.mean(row >= 0)) for row in which])


def _turn_notes(scans: list[Scan]) -> list[str]:
    """A note where points leave a part of the turn out."""
    seen = _seen(scans)
    if seen >= _LEAST_SECTORS:
        return []
    return [
        f"points cover {360 * seen:.0f}° of azimuth only: scans that were cut, or a scanner that does not spin and "
        "draws cones none the less; the pattern has beams all around"
    ]


def _seen(scans: list[Scan]) -> float:
    """Share of the turn in which points lie."""
    azimuth = np.concatenate([scan.azimuth_rad for scan in scans])
    sector = ((azimuth + np.pi) / (2 * np.pi) * _SECTORS).astype(int) % _SECTORS
    return float(np.mean(np.bincount(sector, minlength=_SECTORS) > 0))


def _foreign(which: list[np.ndarray], lasers: int) -> np.ndarray:
    """Total variation distance (scans,) of each scan's distribution over the lasers from the usual one, 0 to 1."""
    counts = np.array([np.bincount(row[row >= 0], minlength=lasers) for row in which], float)
    spread = counts / np.maximum(counts.sum(1, keepdims=True), 1)
    return 0.5 * np.abs(spread - np.median(spread, axis=0)).sum(1) if len(which) > 2 else np.zeros(len(which))


def _demand_one_sensor(
    recording: Recording, scans: list[Scan], lasers: Lasers, which: list[np.ndarray], shares: np.ndarray
) -> None:
    usual = float(np.median(shares))
    other = _foreign(which, len(lasers))
    odd = np.flatnonzero((shares < usual - _ODD_SHARE) | (other > _FOREIGN))
    if len(odd) and usual >= _LEAST_SHARE:
        row = int(odd[0])
        raise RecordingError(
            f"{recording.path}: points of scan {scans[row].name} lie on other lasers than those of the others, as of "
            "several sensors; give the scans of one, as with --scans"
        )
    near = float(np.mean(np.concatenate([scan.flat_range_m for scan in scans]) < NEAREST_M))
    if near > 0.5 and usual < _LEAST_SHARE:
        raise RecordingError(
            f"{recording.path}: {near:.0%} of the points lie within {NEAREST_M:g} m, where a sensor's own size blurs "
            "elevations; record where walls are farther away"
        )
    needed = _LEAST_SHARE if _seen(scans) >= _LEAST_SECTORS else _DOUBTFUL_SHARE
    if not len(lasers) or usual < needed:
        raise RecordingError(
            f"{recording.path}: {usual:.0%} of the points, over {360 * _seen(scans):.0f}° of azimuth, lie on "
            f"{len(lasers)} cones about z, where a sensor that spins has nearly all; scans must be of one such sensor, "
            "in its own axes, not motion-compensated: others want a pattern with raster: or directions: "
            "(docs/howto/sensor.md)"
        )


def _sweep(recording: Recording, scans: list[Scan]) -> tuple[float, list[str]]:
    if recording.settings.sweep_s is not None:
        return recording.settings.sweep_s, []
    spans = [float(scan.time_s.max()) for scan in scans if scan.time_s is not None and len(scan)]
    span = float(np.median(spans)) if spans and _seen(scans) >= _LEAST_SECTORS else None
    interval = recording.interval_s
    if interval is not None and 0.01 < interval < 1:
        numbers = name_numbers(recording.names)
        steps = 1 if numbers is None else int(np.diff(numbers).min())
        if span is not None and interval > _MISSING * span:
            steps = round(interval / span)
        if steps > 1:
            return interval / steps, [
                f"scans are {interval:.3g} s apart, and {steps} sweeps of {interval / steps:.3g} s pass from one to "
                "the next, by the points' times or the numbers in names: others are missing"
            ]
        return interval, []
    if spans:
        return float(np.median(spans)), ["the sweep's duration is that of the points' times"]
    return _USUAL_SWEEP_S, [f"the duration of a sweep is unknown: assumed {_USUAL_SWEEP_S} s; state it with --sweep-s"]


def _blocks(lasers: Lasers) -> tuple[np.ndarray, tuple[float, ...]]:
    """Block of each laser, and the heights of the blocks' centres: two where the centres fall into two groups."""
    centre, weight = lasers.centre_m, np.sqrt(np.maximum(lasers.points, 1))
    none = np.zeros(len(centre), int), (float(np.average(centre, weights=weight)),)
    if len(centre) < 8:
        return none
    splits = range(4, len(centre) - 3)
    spread = [centre[:at].std() ** 2 * at + centre[at:].std() ** 2 * (len(centre) - at) for at in splits]
    at = splits[int(np.argmin(spread))]
    upper, lower = (float(np.average(centre[part], weights=weight[part])) for part in (slice(at), slice(at, None)))
    within = float(np.sqrt(min(spread) / len(centre)))
    if abs(upper - lower) < max(_BLOCKS_APART_M, 5 * within):
        return none
    return (np.arange(len(centre)) >= at).astype(int), (upper, lower)


def _turning_notes(turning: Turning) -> list[str]:
    notes = []
    if turning.fan_known in ("within a step", "not at all"):
        where = "to a whole number of azimuth steps" if turning.fan_known == "within a step" else "at all"
        notes.append(
            f"points come {turning.order}, without times: the lasers' azimuth offsets cannot be determined"
            + (f" but {where}" if turning.fan_known == "within a step" else "; taken to be none")
        )
    if turning.fan_known == "firing order":
        notes.append("azimuth offsets are known up to one azimuth step: the start of a firing cannot be determined")
    if not turning.fixed:
        notes.append(
            f"azimuths lie on no fixed grid: {turning.firings} firings a turn ± {turning.firings_sd:.1f}, from the "
            "distances of neighbouring points"
        )
    if turning.clockwise is False:
        notes.append("azimuths increase along the file, as in sorted files: clockwise rotation is assumed")
    return notes


def _laser_notes(lasers: Lasers, centres: tuple[float, ...]) -> list[str]:
    notes = []
    if lasers.share < _DOUBTFUL_SHARE:
        notes.append(f"{1 - lasers.share:.1%} of the points lie on no beam")
    few = np.flatnonzero(lasers.points < 0.02 * np.median(lasers.points))
    if len(few):
        notes.append(f"{len(few)} lasers have very few points: {_degrees(lasers.elevation_deg[few])}")
    notes.append("a laser without any return in these scans is not known")
    if len(centres) == 2:
        notes.append(
            f"two optical centres, {centres[0]:+.4f} and {centres[1]:+.4f} m along the axis: add "
            f"{{effect: dual_block, upper_m: {centres[0]:.4f}, lower_m: {centres[1]:.4f}}} to the sensor file"
        )
    elif abs(centres[0]) > _BLOCKS_APART_M:
        notes.append(f"the optical centre lies {centres[0]:+.3f} m along the axis from the origin of the points")
    return notes


def _degrees(values: np.ndarray) -> str:
    shown = ", ".join(f"{value:+.2f}°" for value in values[:6])
    return shown + (" …" if len(values) > 6 else "")

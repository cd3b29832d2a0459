"""The noise floor: the one error of the true sensor, against the data that it made, by ensembles.

Scores of ensembles are the fair ones (Ferro 2014, Q. J. R. Meteorol. Soc. 140), which do not depend on the number of
members: CRPS = mean |x − y| − Σ |x − x'| / (2 m (m − 1)); Brier = (p − y)² − p (1 − p) / (m − 1).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from tests.hidden.head import Beams, nominal_beams
from tests.hidden.physics import CLUTTER, Truth, measure
from tests.hidden.scan import Scan
from tests.hidden.twin_files import read_frames, read_pattern
from tests.hidden.twin_tracing import Twin

SCALES = {"range": 0.01, "intensity": 0.05, "drop": 0.02, "spurious": 1.0}
_CLIP_M = 1.0
_EDGE = 0.05


@dataclass(frozen=True)
class Floor:
    """The error of the true sensor.

    Attributes:
        error: mean of the channels' scores over their scales.
        channels: mean score by channel, in its own unit.
    """

    error: float
    channels: dict[str, float]


@dataclass(frozen=True, eq=False)
class _Measured:
    """What was reported, a row a beam."""

    found: np.ndarray
    range_m: np.ndarray
    intensity: np.ndarray

    @classmethod
    def of(cls, scan: Scan) -> _Measured:
        return cls(scan.found.copy(), scan.range_m.copy(), scan.intensity.copy())


def noise_floor(
    truth: Truth, drive: Path, frames: Iterable[int], members: int = 12, seed: int = 0, world: Path | None = None
) -> Floor:
    """Score the true sensor on some frames of a drive.

    Args:
        truth: the true sensor.
        drive: a made drive, with `rays/`.
        world: the drive with the true twin if nuisances changed the twin of the made one; None for its own.
        frames: rows of its frames.
        members: of the ensemble.
        seed: of the ensemble; its noise is not the data's.
    """
    beams, world = nominal_beams(read_pattern(drive)), world or drive
    twin, everything = Twin(world / "twin"), read_frames(world)
    sums: dict[str, list[float]] = {"range": [], "intensity": [], "drop": []}
    predicted, found, beams_in_all = 0.0, 0.0, 0
    for row in frames:
        frame, rng = everything[row], np.random.default_rng([seed, 91, row])
        elapsed = frame["time_s"] - everything[0]["time_s"]

        def sensor(true: Truth, frame=frame, rng=rng, elapsed=elapsed, known=None) -> Scan:
            return measure(true, twin, frame, beams, rng, elapsed, known)

        first = sensor(_without_noise(truth))
        known = None if truth.bends_at_random else (first.solid, first.pane)
        ensemble = [_Measured.of(sensor(truth, known=known)) for _ in range(members)]
        data = read_measured(drive, frame["frame"], beams)
        clear = ~edges(first)
        for channel, scores in _scores(ensemble, data, clear).items():
            sums[channel].append(float(scores.mean()))
        predicted += np.mean([_spurious(member, first) for member in ensemble])
        found += _spurious(data, first)
        beams_in_all += len(beams.ring)
    channels = {name: float(np.mean(values)) for name, values in sums.items()}
    channels["spurious"] = float(abs(predicted - found) / beams_in_all * 1000)
    return Floor(float(np.mean([channels[name] / scale for name, scale in SCALES.items()])), channels)


def read_measured(drive: Path, name: str, beams: Beams) -> _Measured:
    """A drive's frame, a row a beam."""
    points = np.fromfile(drive / "velodyne" / f"{name}.bin", "<f4").reshape(-1, 4).astype(float)
    with np.load(drive / "rays" / f"{name}.npz") as rays:
        ring, azimuth = rays["ring"].astype(int), rays["azimuth"]
    nominal = beams.azimuth.reshape(beams.rings, beams.firings)
    turned = np.mod(nominal[:, 0][ring] - azimuth, 2 * np.pi)
    row = ring * beams.firings + np.round(turned * beams.firings / (2 * np.pi)).astype(int) % beams.firings
    report = _Measured(np.zeros(len(beams.ring), bool), np.zeros(len(beams.ring)), np.zeros(len(beams.ring)))
    # The reported centre is on the sensor's axis: range = projection on the beam, less the centre's.
    direction, flat = beams.direction[row], np.hypot(points[:, 0], points[:, 1])
    report.range_m[row] = flat / np.hypot(direction[:, 0], direction[:, 1])
    report.found[row], report.intensity[row] = True, points[:, 3]
    return report


def edges(scan: Scan) -> np.ndarray:
    """(n,) bool: a neighbour in the grid sees something else, or 5 % nearer or farther."""
    shape = (scan.beams.rings, scan.beams.firings)
    distance = np.where(np.isfinite(scan.solid.distance), scan.solid.distance, 1e4).reshape(shape)
    near = np.zeros(shape, bool)
    jump = np.abs(np.diff(np.log(distance), axis=1)) > _EDGE
    near[:, 1:] |= jump
    near[:, :-1] |= jump
    other = np.diff(scan.solid.instance.reshape(shape), axis=0) != 0
    near[1:] |= other
    near[:-1] |= other
    return near.ravel()


def _without_noise(truth: Truth) -> Truth:
    """The sensor without noise, loss or clutter: only the surfaces."""
    noisy = ("range_noise", "intensity_noise", "random_dropout", "detection_threshold", *CLUTTER)
    aims = {} if truth.bends_at_random else dict(truth.at("aim"))
    effects = {name: p for name, p in truth.effects.items() if name not in noisy}
    return replace(truth, effects=effects, unseen=aims, outliers=0.0)


def _scores(ensemble: list[_Measured], data: _Measured, clear: np.ndarray) -> dict[str, np.ndarray]:
    found = np.stack([member.found for member in ensemble])
    m, chance = len(ensemble), found.mean(0)
    matched = data.found & (chance >= 0.5) & clear
    drop = (chance - data.found) ** 2 - chance * (1 - chance) / (m - 1)
    scores = {"drop": drop[clear]}
    for name, limit in (("range_m", _CLIP_M), ("intensity", np.inf)):
        report = np.stack([getattr(member, name)[matched] for member in ensemble])
        heard = found[:, matched]
        report = np.where(heard, report, np.nan)
        filled = np.where(heard, report, np.nanmedian(report, axis=0))
        scores[name.removesuffix("_m")] = _crps(filled, getattr(data, name)[matched], limit)
    return scores


def _crps(members: np.ndarray, result: np.ndarray, limit: float) -> np.ndarray:
    middle = np.median(members, axis=0)
    members, result = np.clip(members - middle, -limit, limit), np.clip(result - middle, -limit, limit)
    m = len(members)
    ranked = np.sort(members, axis=0)
    weight = (2 * np.arange(1, m + 1) - m - 1)[:, None]
    spread = (weight * ranked).sum(0) * 2  # Σ |x − x'| over ordered pairs
    return np.abs(members - result).mean(0) - spread / (2 * m * (m - 1))


def _spurious(values: _Measured, surface: Scan) -> float:
    off = np.abs(values.range_m - surface.range_m) > _CLIP_M
    return float((values.found & (off | ~surface.found)).sum())

"""The one error, and what it is made of.

Predictions are ensembles: the sensor model is run several times, and its scores are those of the empirical
distribution made fair for the number of members (Ferro, Q. J. R. Meteorol. Soc. 2014), so that few suffice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from sensors.effects.acting import Streams, act_on_returns
from sensors.effects.base import Effect
from sensors.shot import returns_of

CLIP_M = 1.0
MEMBERS = 4
_STREAM = 0x6D6F6465
SCALES = {"range": 0.01, "intensity": 0.05, "drop": 0.02, "spurious": 1.0}


def model_chance(seed: int, number: int) -> np.random.Generator:
    """The model's chance in a frame: another than the one that `cosim run` measures frames of that number with.

    A model that draws the very noise that a simulated drive was made with would be better than its noise lets be.
    """
    return np.random.default_rng([seed, number, _STREAM])


@dataclass(frozen=True, eq=False)
class FrameScores:
    """What a model says of one frame and how it fares, by beam.

    Attributes:
        range_m: (n,) mean predicted range; NaN where nothing is expected.
        measured_m: (n,) measured range; NaN where nothing returned.
        intensity, measured_intensity: (n,).
        expected: (n,) share of members in which the surface returns.
        matched: (n,) bool: returned from about where the model expects.
        spurious: (n,) bool: returned from where nothing is.
        ambiguous: (n,) bool: at edges, or not trusted.
        range_score, intensity_score: (n,) CRPS; NaN where not matched.
        brier: (n,) fair Brier score of returning; NaN where ambiguous.
        foreseen: expected number of spurious returns.
    """

    range_m: np.ndarray
    measured_m: np.ndarray
    intensity: np.ndarray
    measured_intensity: np.ndarray
    expected: np.ndarray
    matched: np.ndarray
    spurious: np.ndarray
    ambiguous: np.ndarray
    range_score: np.ndarray
    intensity_score: np.ndarray
    brier: np.ndarray
    foreseen: float


def score_frame(frame: TracedFrame, effects: Sequence[Effect], rng: np.random.Generator, origin: str) -> FrameScores:
    """Scores of a traced frame under effects in the order in which they act; `origin` names the sensor in errors."""
    ranges, intensities = _ensemble(frame, effects, rng, origin)
    members = len(ranges)
    measured = frame.observed.range_from(frame.shot.rays.origin)
    returned = frame.observed.returned
    # What is spurious is told alike of model and measurement: far from every surface the beam can meet.
    surfaces = _surfaces(frame)
    strays = ~np.isnan(ranges) & ~_near(ranges, surfaces)
    spurious = returned & ~_near(measured[None], surfaces)[0]
    ambiguous = frame.edge | ~frame.observed.trusted
    real = np.where(strays, np.nan, ranges)
    there = ~np.isnan(real)
    share = there.mean(0)
    matched = returned & ~spurious & ~ambiguous & there.any(0)
    answered = (~np.isnan(ranges)).mean(0)
    outcome = returned.astype(float)
    brier = (answered - outcome) ** 2
    if members > 1:
        brier -= answered * (1 - answered) / (members - 1)
    with np.errstate(invalid="ignore"):
        mean_range = np.where(share > 0, np.nansum(real, 0) / np.maximum(there.sum(0), 1), np.nan)
        mean_intensity = np.where(
            share > 0, np.nansum(np.where(there, intensities, 0), 0) / np.maximum(there.sum(0), 1), np.nan
        )
    gap = np.abs(measured - mean_range)
    matched &= gap < 2 * CLIP_M
    return FrameScores(
        range_m=mean_range,
        measured_m=measured,
        intensity=mean_intensity,
        measured_intensity=frame.observed.intensity,
        expected=share,
        matched=matched,
        spurious=spurious & ~ambiguous,
        ambiguous=ambiguous,
        range_score=np.where(matched, _crps(real, measured, CLIP_M), np.nan),
        intensity_score=np.where(
            matched, _crps(np.where(there, intensities, np.nan), frame.observed.intensity, np.inf), np.nan
        ),
        brier=np.where(ambiguous, np.nan, brier),
        foreseen=float((strays & ~ambiguous).sum() / members),
    )


def _ensemble(
    frame: TracedFrame, effects: Sequence[Effect], rng: np.random.Generator, origin: str
) -> tuple[np.ndarray, np.ndarray]:
    """Ranges and intensities (m, n) of the model's members, NaN for no return; one where chance plays no part."""
    ranges = np.full((MEMBERS, len(frame.shot.rays)), np.nan, np.float32)
    intensities = ranges.copy()
    for member in range(MEMBERS):
        returns = act_on_returns(effects, returns_of(frame.shot.hits), frame.shot, Streams(rng), origin)
        first = np.flatnonzero(returns.return_no == 0)
        ranges[member, returns.beam[first]] = returns.range_m[first]
        intensities[member, returns.beam[first]] = returns.intensity[first]
        same = np.array_equal(ranges[0], ranges[1], equal_nan=True)
        if member == 1 and same and np.array_equal(intensities[0], intensities[1], equal_nan=True):
            return ranges[:1], intensities[:1]
    return ranges, intensities


def _crps(members: np.ndarray, measured: np.ndarray, clip: float) -> np.ndarray:
    """Fair CRPS (n,) of ensembles (m, n) with gaps; distances clipped, which keeps the score proper."""
    there = ~np.isnan(members)
    count = there.sum(0)
    away = np.where(there, np.minimum(np.abs(members - measured), clip), 0).sum(0) / np.maximum(count, 1)
    spread = np.zeros(members.shape[1])
    for i in range(len(members)):
        for j in range(i):
            both = there[i] & there[j]
            spread += np.where(both, np.minimum(np.abs(members[i] - members[j]), clip), 0)
    pairs = count * (count - 1)
    return away - np.where(pairs > 0, spread / np.maximum(pairs, 1), 0)


def _surfaces(frame: TracedFrame) -> np.ndarray:
    """Ranges of the surfaces that beams can meet, (2, n): solid and pane; NaN where there is none."""
    hits = frame.shot.hits
    found = np.full((2, len(frame.shot.rays)), np.nan)
    found[0] = np.where(hits.solid.exists, hits.solid.range_m, np.nan)
    found[1, hits.pane_beam] = hits.pane.range_m
    return found


def _near(ranges: np.ndarray, surfaces: np.ndarray) -> np.ndarray:
    near = np.zeros(ranges.shape, bool)
    for surface in surfaces:
        near |= np.abs(ranges - surface) < CLIP_M
    return near

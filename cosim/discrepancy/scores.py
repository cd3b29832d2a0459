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
from sensors.effects.base import Effect, RoundingEffect
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
        stray: (n,) expected share of them by beam; 0 where ambiguous.
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
    stray: np.ndarray


@dataclass(frozen=True, eq=False)
class Totals:
    """Sums over frames from which all figures follow."""

    frames: int = 0
    points: int = 0
    beams: int = 0
    matched: int = 0
    squared: float = 0.0
    absolute: float = 0.0
    signed: float = 0.0
    range_score: float = 0.0
    lit: int = 0
    intensity_squared: float = 0.0
    intensity_signed: float = 0.0
    intensity_score: float = 0.0
    brier: float = 0.0
    dropped: int = 0
    foreseen_drops: float = 0.0
    hit_drops: float = 0.0
    spurious: int = 0
    foreseen: float = 0.0
    strays: int = 0
    bad: int = 0

    def __add__(self, other: Totals) -> Totals:
        return Totals(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))

    @classmethod
    def of(cls, frame: TracedFrame, scores: FrameScores) -> Totals:
        """Those of one frame."""
        matched = scores.matched
        residual = (scores.measured_m - scores.range_m)[matched].astype(np.float64)
        lit = matched & np.isfinite(scores.intensity_score)
        bright = (scores.measured_intensity - scores.intensity)[lit].astype(np.float64)
        clear = ~scores.ambiguous
        could = clear & (scores.expected > 0)
        missing = could & np.isnan(scores.measured_m)
        return cls(
            frames=1,
            points=frame.observed.points,
            beams=int(clear.sum()),
            matched=int(matched.sum()),
            squared=float(residual @ residual),
            absolute=float(np.abs(residual).sum()),
            signed=float(residual.sum()),
            range_score=float(scores.range_score[matched].sum()),
            lit=int(lit.sum()),
            intensity_squared=float(bright @ bright),
            intensity_signed=float(bright.sum()),
            intensity_score=float(scores.intensity_score[lit].sum()),
            brier=float(np.nansum(scores.brier)),
            dropped=int(missing.sum()),
            foreseen_drops=float((1 - scores.expected[could]).sum()),
            hit_drops=float((1 - scores.expected[missing]).sum()),
            spurious=int(scores.spurious.sum()),
            foreseen=scores.foreseen,
            strays=frame.observed.strays,
            bad=frame.observed.bad,
        )

    def parts(self) -> dict[str, float]:
        """Mean score of each channel that is present, in its own unit."""
        parts = {}
        if self.matched:
            parts["range"] = self.range_score / self.matched
        if self.lit:
            parts["intensity"] = self.intensity_score / self.lit
        if self.beams:
            parts["drop"] = self.brier / self.beams
            parts["spurious"] = abs(self.foreseen - self.spurious) / self.beams * 1000
        return parts

    @property
    def error(self) -> float:
        """The one number."""
        parts = self.parts()
        return float(np.mean([parts[name] / SCALES[name] for name in parts])) if parts else float("nan")


@dataclass(frozen=True, eq=False)
class Ensemble:
    """What several runs of a model say of one frame.

    Attributes:
        range_m, intensity: (m, n) of the members before they are rounded; NaN for no return.
        rounding: effects that round them, one after the other.
    """

    range_m: np.ndarray
    intensity: np.ndarray
    rounding: tuple[RoundingEffect, ...] = ()

    @classmethod
    def of(cls, frame: TracedFrame, effects: Sequence[Effect], rng: np.random.Generator, origin: str) -> Ensemble:
        """Of effects in the order in which they act, one member where chance plays no part; see `score_frame`."""
        ranges = np.full((MEMBERS, len(frame.shot.rays)), np.nan, np.float32)
        intensities = ranges.copy()
        rounding = tuple(one for one in effects if isinstance(one, RoundingEffect))
        effects = [one for one in effects if not isinstance(one, RoundingEffect)]
        for member in range(MEMBERS):
            returns = act_on_returns(effects, returns_of(frame.shot.hits), frame.shot, Streams(rng), origin)
            first = np.flatnonzero(returns.return_no == 0)
            ranges[member, returns.beam[first]] = returns.range_m[first]
            intensities[member, returns.beam[first]] = returns.intensity[first]
            same = np.array_equal(ranges[0], ranges[1], equal_nan=True)
            if member == 1 and same and np.array_equal(intensities[0], intensities[1], equal_nan=True):
                return cls(ranges[:1], intensities[:1], rounding)
        return cls(ranges, intensities, rounding)

    def moved(self, shift_m: np.ndarray | float, gain: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Ranges and intensities (m, n) as they are stored where surfaces are (n,) nearer or darker than was traced."""
        ranges, intensities = self.range_m + shift_m, np.clip(self.intensity * gain, 0, 1)
        for effect in self.rounding:
            ranges, intensities = effect.rounded(ranges, intensities)
        return ranges, intensities


def score_frame(frame: TracedFrame, effects: Sequence[Effect], rng: np.random.Generator, origin: str) -> FrameScores:
    """Scores of a traced frame under effects in the order in which they act; `origin` names the sensor in errors."""
    return scored(frame, Ensemble.of(frame, effects, rng, origin))


def scored(
    frame: TracedFrame,
    ensemble: Ensemble,
    shift_m: np.ndarray | float = 0.0,
    gain: np.ndarray | float = 1.0,
    wide: np.ndarray | None = None,
) -> FrameScores:
    """Scores of an ensemble.

    Args:
        frame: traced.
        ensemble: of a model.
        shift_m, gain: (n,) what the ranges of surfaces are shifted by, and their intensities multiplied with, where
            they are known to be off.
        wide: (n,) bool beams that are ambiguous beside those at edges.
    """
    ranges, intensities = ensemble.moved(shift_m, gain)
    members = len(ranges)
    measured = frame.observed.range_from(frame.shot.rays.origin)
    returned = frame.observed.returned
    # What is spurious is told alike of model and measurement: far from every surface the beam can meet.
    surfaces = _surfaces(frame) + shift_m
    strays = ~np.isnan(ranges) & ~_near(ranges, surfaces)
    spurious = returned & ~_near(measured[None], surfaces)[0]
    ambiguous = (frame.edge if wide is None else wide) | ~frame.observed.trusted
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
        stray=np.where(ambiguous, 0.0, strays.mean(0)),
    )


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

"""The error of a model and its channels: fair proper scores of ensemble predictions.

The sensor model is sampled several times. The scores are those of the empirical distribution with a correction for the
number of members (fair scores; Ferro, Q. J. R. Meteorol. Soc. 140, 2014), so that a few members suffice.
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
    """Random generator for sampling the model in a frame, independent of the one of `cosim run`.

    With the same generator the model could reproduce the noise of a simulated drive, and the error would be too low.
    """
    return np.random.default_rng([seed, number, _STREAM])


@dataclass(frozen=True, eq=False)
class FrameScores:
    """Predictions and scores of one frame, by beam.

    Attributes:
        range_m: (n,) mean predicted range [m]; NaN if no return is predicted.
        measured_m: (n,) measured range [m]; NaN without a return.
        intensity, measured_intensity: (n,) mean predicted and measured intensity.
        expected: (n,) share of members with a return of the surface.
        matched: (n,) bool returns close to the predicted range.
        spurious: (n,) bool returns away from all surfaces of the beam.
        ambiguous: (n,) bool beams at edges, or not comparable.
        range_score, intensity_score: (n,) CRPS ([m]; intensity); NaN if not matched.
        brier: (n,) fair Brier score of the return; NaN if ambiguous.
        foreseen: predicted number of spurious returns.
        spurious_probability: (n,) predicted probability of a spurious return by beam; 0 if ambiguous.
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
    spurious_probability: np.ndarray


@dataclass(frozen=True, eq=False)
class Totals:
    """Sums over frames from which all statistics are computed; sums can be added.

    Attributes:
        frames, points, beams: numbers of frames, points and unambiguous beams.
        matched: number of matched returns.
        squared, absolute, signed: sums of their range residuals squared [m²], absolute [m] and signed [m].
        range_score: sum of their CRPS [m].
        lit: number of matched returns with intensity.
        intensity_squared, intensity_signed, intensity_score: sums of their intensity residuals and CRPS.
        brier: sum of Brier scores.
        dropped: number of beams without the predicted return.
        foreseen_drops: predicted number of dropped returns.
        hit_drops: sum of the predicted drop probabilities of beams that were dropped.
        spurious, foreseen: measured and predicted number of spurious returns.
        unmatched, bad: numbers of points that fit no beam, and with NaN or infinity.
    """

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
    unmatched: int = 0
    bad: int = 0

    def __add__(self, other: Totals) -> Totals:
        return Totals(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))

    @classmethod
    def of(cls, frame: TracedFrame, scores: FrameScores) -> Totals:
        """Compute the sums of one frame."""
        matched = scores.matched
        residual = (scores.measured_m - scores.range_m)[matched].astype(np.float64)
        has_intensity = matched & np.isfinite(scores.intensity_score)
        intensity_residual = (scores.measured_intensity - scores.intensity)[has_intensity].astype(np.float64)
        clear = ~scores.ambiguous
        is_predicted = clear & (scores.expected > 0)
        is_dropped = is_predicted & np.isnan(scores.measured_m)
        return cls(
            frames=1,
            points=frame.observed.points,
            beams=int(clear.sum()),
            matched=int(matched.sum()),
            squared=float(residual @ residual),
            absolute=float(np.abs(residual).sum()),
            signed=float(residual.sum()),
            range_score=float(scores.range_score[matched].sum()),
            lit=int(has_intensity.sum()),
            intensity_squared=float(intensity_residual @ intensity_residual),
            intensity_signed=float(intensity_residual.sum()),
            intensity_score=float(scores.intensity_score[has_intensity].sum()),
            brier=float(np.nansum(scores.brier)),
            dropped=int(is_dropped.sum()),
            foreseen_drops=float((1 - scores.expected[is_predicted]).sum()),
            hit_drops=float((1 - scores.expected[is_dropped]).sum()),
            spurious=int(scores.spurious.sum()),
            foreseen=scores.foreseen,
            unmatched=frame.observed.unmatched,
            bad=frame.observed.bad,
        )

    def parts(self) -> dict[str, float]:
        """Mean score of each channel that is present: range [m], intensity, drop, spurious (per 1000 beams)."""
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
        """Mean of the channels' scores, each divided by its scale in `SCALES`; NaN without any."""
        parts = self.parts()
        return float(np.mean([parts[name] / SCALES[name] for name in parts])) if parts else float("nan")


@dataclass(frozen=True)
class Adjustment:
    """Changes of the prediction of n beams by known random effects.

    Attributes:
        shift_m: (n,) shift of ranges [m].
        gain: (n,) factor on intensities.
        silent: (n,) change of the probability of no return: darker surfaces are lost more often.
    """

    shift_m: np.ndarray | float = 0.0
    gain: np.ndarray | float = 1.0
    silent: np.ndarray | float = 0.0


@dataclass(frozen=True, eq=False)
class Ensemble:
    """Ensemble prediction of one frame.

    Attributes:
        range_m, intensity: (m, n) values of the members before rounding ([m]; 0 to 1); NaN for no return.
        rounding: rounding effects, in the order in which they act.
    """

    range_m: np.ndarray
    intensity: np.ndarray
    rounding: tuple[RoundingEffect, ...] = ()

    @classmethod
    def of(cls, frame: TracedFrame, effects: Sequence[Effect], rng: np.random.Generator, origin: str) -> Ensemble:
        """Sample the effects, given in the order in which they act; one member if the model is deterministic.

        Where the texture of surfaces is unknown, each member has another one.
        """
        ranges = np.full((MEMBERS, len(frame.shot.rays)), np.nan, np.float32)
        intensities = ranges.copy()
        rounding = tuple(effect for effect in effects if isinstance(effect, RoundingEffect))
        effects = [effect for effect in effects if not isinstance(effect, RoundingEffect)]
        for member in range(MEMBERS):
            shot = frame.shot if frame.shot.is_texture_known else frame.shot.with_texture(member + 1)
            returns = act_on_returns(effects, returns_of(shot.hits), shot, Streams(rng), origin)
            first = np.flatnonzero(returns.return_no == 0)
            ranges[member, returns.beam[first]] = returns.range_m[first]
            intensities[member, returns.beam[first]] = returns.intensity[first]
            same = np.array_equal(ranges[0], ranges[1], equal_nan=True)
            if member == 1 and same and np.array_equal(intensities[0], intensities[1], equal_nan=True):
                return cls(ranges[:1], intensities[:1], rounding)
        return cls(ranges, intensities, rounding)

    def moved(self, shift_m: np.ndarray | float, gain: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Rounded ranges [m] and intensities (m, n) after a shift of ranges and a factor on intensities, (n,) each."""
        ranges, intensities = self.range_m + shift_m, np.clip(self.intensity * gain, 0, 1)
        for effect in self.rounding:
            ranges, intensities = effect.rounded(ranges, intensities)
        return ranges, intensities


def score_frame(frame: TracedFrame, effects: Sequence[Effect], rng: np.random.Generator, origin: str) -> FrameScores:
    """Score a traced frame under effects in the order in which they act; `origin` names the sensor in messages."""
    return scored(frame, Ensemble.of(frame, effects, rng, origin))


def scored(
    frame: TracedFrame,
    ensemble: Ensemble,
    adjustment: Adjustment | None = None,
    wide: np.ndarray | None = None,
) -> FrameScores:
    """Score an ensemble.

    Args:
        frame: traced frame.
        ensemble: ensemble prediction of a model.
        adjustment: by known random effects; default: none.
        wide: (n,) bool ambiguous beams, replaces `frame.edge`.
    """
    by = Adjustment() if adjustment is None else adjustment
    ranges, intensities = ensemble.moved(by.shift_m, by.gain)
    members = len(ranges)
    measured = frame.observed.range_from(frame.shot.rays.origin)
    returned = frame.observed.returned
    # Spurious returns are defined in the same way for model and measurement: far from all surfaces of the beam.
    surfaces = _surfaces(frame) + by.shift_m
    is_stray = ~np.isnan(ranges) & ~_near(ranges, surfaces)
    spurious = returned & ~_near(measured[None], surfaces)[0]
    ambiguous = (frame.edge if wide is None else wide) | ~frame.observed.trusted
    surface_ranges = np.where(is_stray, np.nan, ranges)
    has_return = ~np.isnan(surface_ranges)
    return_share = has_return.mean(0)
    matched = returned & ~spurious & ~ambiguous & has_return.any(0)
    reported_share = (~np.isnan(ranges)).mean(0)
    outcome = returned.astype(float)
    brier = (np.clip(reported_share - by.silent, 0, 1) - outcome) ** 2
    if members > 1:
        brier -= reported_share * (1 - reported_share) / (members - 1)
    with np.errstate(invalid="ignore"):
        mean_range = np.where(return_share > 0, np.nansum(surface_ranges, 0) / np.maximum(has_return.sum(0), 1), np.nan)
        mean_intensity = np.where(
            return_share > 0,
            np.nansum(np.where(has_return, intensities, 0), 0) / np.maximum(has_return.sum(0), 1),
            np.nan,
        )
    gap = np.abs(measured - mean_range)
    matched &= gap < 2 * CLIP_M
    return FrameScores(
        range_m=mean_range,
        measured_m=measured,
        intensity=mean_intensity,
        measured_intensity=frame.observed.intensity,
        expected=return_share,
        matched=matched,
        spurious=spurious & ~ambiguous,
        ambiguous=ambiguous,
        range_score=np.where(matched, _crps(surface_ranges, measured, CLIP_M), np.nan),
        intensity_score=np.where(
            matched, _crps(np.where(has_return, intensities, np.nan), frame.observed.intensity, np.inf), np.nan
        ),
        brier=np.where(ambiguous, np.nan, brier),
        foreseen=float((is_stray & ~ambiguous).sum() / members),
        spurious_probability=np.where(ambiguous, 0.0, is_stray.mean(0)),
    )


def spurious_ranges(frame: TracedFrame, ensemble: Ensemble) -> np.ndarray:
    """Ranges (m, n) [m] of the members' returns that are away from all surfaces of the beam; NaN for others."""
    return np.where(_near(ensemble.range_m, _surfaces(frame)), np.nan, ensemble.range_m)


def _crps(members: np.ndarray, measured: np.ndarray, clip: float) -> np.ndarray:
    """Fair CRPS (n,) of ensembles (m, n) with missing values; clipped distances, which keep the score proper."""
    is_present = ~np.isnan(members)
    count = is_present.sum(0)
    distance = np.where(is_present, np.minimum(np.abs(members - measured), clip), 0).sum(0) / np.maximum(count, 1)
    spread = np.zeros(members.shape[1])
    for i in range(len(members)):
        for j in range(i):
            both = is_present[i] & is_present[j]
            spread += np.where(both, np.minimum(np.abs(members[i] - members[j]), clip), 0)
    pairs = count * (count - 1)
    return distance - np.where(pairs > 0, spread / np.maximum(pairs, 1), 0)


def _surfaces(frame: TracedFrame) -> np.ndarray:
    """Ranges (2, n) [m] of the surfaces that beams can hit: solid and pane; NaN for none."""
    hits = frame.shot.hits
    ranges = np.full((2, len(frame.shot.rays)), np.nan)
    ranges[0] = np.where(hits.solid.exists, hits.solid.range_m, np.nan)
    ranges[1, hits.pane_beam] = hits.pane.range_m
    return ranges


def _near(ranges: np.ndarray, surfaces: np.ndarray) -> np.ndarray:
    """Mask (m, n) of ranges (m, n) within `CLIP_M` of any of the surfaces (s, n)."""
    near = np.zeros(ranges.shape, bool)
    for surface in surfaces:
        near |= np.abs(ranges - surface) < CLIP_M
    return near

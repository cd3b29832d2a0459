"""Noise floor: the error due to noise, estimated from neighbouring beams.

Two consecutive beams on one surface share the errors of the model; their difference is noise. The mean distance of two
independent draws is twice the expected CRPS of the true distribution. The number of spurious returns is
Poisson-distributed with mean λ; its mean absolute deviation from the mean over the members of an ensemble is
√(2λ(1 + 1/members)/π) in the normal approximation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.scores import CLIP_M, MEMBERS, SCALES, FrameScores
from sensors.effects.expectation import Expectation


@dataclass(frozen=True, eq=False)
class NoiseFloor:
    """The error of a model that is correct up to noise.

    Attributes:
        error: error as in `compare` (dimensionless).
        parts: mean score by channel, in the channel's unit (see `Totals.parts`).
        how: description of the estimate.
    """

    error: float
    parts: dict[str, float]
    how: str

    @classmethod
    def of(cls, sums: Sequence[dict[str, tuple[float, int]]]) -> NoiseFloor | None:
        """Combine the sums of all frames; None without matched returns."""
        parts = {}
        for name in ("range", "intensity", "drop"):
            total = sum(frame_sums[name][0] for frame_sums in sums if name in frame_sums)
            count = sum(frame_sums[name][1] for frame_sums in sums if name in frame_sums)
            if count:
                parts[name] = total / count
        if "range" not in parts:
            return None
        spurious_count, beams = (sum(frame_sums["spurious"][part] for frame_sums in sums) for part in (0, 1))
        parts["spurious"] = 1000 * float(np.sqrt(2 / np.pi * (1 + 1 / MEMBERS) * spurious_count)) / max(beams, 1)
        error = float(np.mean([parts[name] / SCALES[name] for name in parts]))
        return cls(error, parts, "estimated from how much neighbouring beams on one surface differ")


@dataclass(frozen=True, eq=False)
class NeighbourPairs:
    """Differences of neighbouring beams of a frame.

    Attributes:
        pair: (n − 1,) bool whether a beam and the next one are in the same ring and hit the same surface.
        gaps: by channel, (k,) differences of their residuals, and (k,) stated variances of the differences.
    """

    pair: np.ndarray
    gaps: dict[str, tuple[np.ndarray, np.ndarray]]

    @classmethod
    def of(cls, frame: TracedFrame, scores: FrameScores, expected: Expectation) -> NeighbourPairs:
        """Compute the differences of a frame.

        Args:
            frame, scores: traced frame and its scores.
            expected: expectation of the model, without its random sampling, which would add noise.
        """
        solid, ring = frame.shot.hits.solid, frame.shot.rays.ring
        pair = (ring[1:] == ring[:-1]) & (solid.instance[1:] == solid.instance[:-1])
        pair &= (solid.material[1:] == solid.material[:-1]) & ~scores.ambiguous[1:] & ~scores.ambiguous[:-1]
        both = pair & scores.matched[1:] & scores.matched[:-1]
        both &= np.isfinite(expected.range_m[1:]) & np.isfinite(expected.range_m[:-1])
        lit = both & np.isfinite(scores.intensity_score[1:]) & np.isfinite(scores.intensity_score[:-1])
        gaps = {}
        for name, used, residual, sigma in (
            ("range", both, scores.measured_m - expected.range_m, expected.range_sigma_m),
            ("intensity", lit, scores.measured_intensity - expected.intensity, expected.intensity_sigma),
        ):
            variance = sigma.astype(np.float64) ** 2
            gaps[name] = np.diff(residual)[used], (variance[1:] + variance[:-1])[used]
        return cls(pair, gaps)


def estimate_floor(
    neighbours: NeighbourPairs, scores: FrameScores, expected: Expectation
) -> dict[str, tuple[float, int]]:
    """Sums and counts of a frame's scores by channel if there were only noise.

    Args:
        neighbours: differences of neighbouring beams of the frame.
        scores, expected: scores and expectation that they were computed from.
    """
    gap, intensity_gap = np.minimum(np.abs(neighbours.gaps["range"][0]), CLIP_M), neighbours.gaps["intensity"][0]
    sums = {"range": (float(gap.sum()) / 2, len(gap))}
    if len(intensity_gap):
        sums["intensity"] = (float(np.abs(intensity_gap).sum()) / 2, len(intensity_gap))
    outcome = (~np.isnan(scores.measured_m)).astype(float)
    # Independent outcomes with probability p differ with probability 2p(1 − p), twice the Brier score of the forecast
    # p. With probabilities p and q, (p − q)² is added.
    excess = np.abs(np.diff(outcome)) - np.diff(expected.silent) ** 2
    sums["drop"] = (max(float(excess[neighbours.pair].sum()), 0.0) / 2, int(neighbours.pair.sum()))
    sums["spurious"] = scores.foreseen, int((~scores.ambiguous).sum())
    return sums

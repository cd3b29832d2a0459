"""What error noise alone makes, estimated from neighbouring beams.

Two beams fired one after the other at one surface share whatever a model may lack; what they do not share is noise.
The mean distance of two independent draws is twice the CRPS that the true distribution gets on average.
Counts of spurious returns are off by chance, too: their law is Poisson's, whose mean distance from its mean λ, and from
a mean over few members of an ensemble, is that of a normal law, √(2λ(1 + 1/members)/π).
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
    """The error of a model that is right up to noise.

    Attributes:
        error: in the terms of `compare`.
        parts: by channel, in its own unit.
        how: how it is known.
    """

    error: float
    parts: dict[str, float]
    how: str

    @classmethod
    def of(cls, sums: Sequence[dict[str, tuple[float, int]]]) -> NoiseFloor | None:
        """From the sums of all frames; None where nothing matched."""
        parts = {}
        for name in ("range", "intensity", "drop"):
            total = sum(one[name][0] for one in sums if name in one)
            count = sum(one[name][1] for one in sums if name in one)
            if count:
                parts[name] = total / count
        if "range" not in parts:
            return None
        strays, beams = (sum(one["spurious"][part] for one in sums) for part in (0, 1))
        parts["spurious"] = 1000 * float(np.sqrt(2 / np.pi * (1 + 1 / MEMBERS) * strays)) / max(beams, 1)
        error = float(np.mean([parts[name] / SCALES[name] for name in parts]))
        return cls(error, parts, "estimated from how much neighbouring beams on one surface differ")


@dataclass(frozen=True, eq=False)
class Neighbours:
    """How neighbouring beams of a frame differ.

    Attributes:
        pair: (n − 1,) bool: beams and the next of the same ring at the same surface.
        gaps: by channel, (k,) differences of their residuals, and the variances (k,) stated for these.
    """

    pair: np.ndarray
    gaps: dict[str, tuple[np.ndarray, np.ndarray]]

    @classmethod
    def of(cls, frame: TracedFrame, scores: FrameScores, expected: Expectation) -> Neighbours:
        """Those of a frame with its scores.

        Args:
            frame, scores: of the frame.
            expected: by the model, its own chance left out, which would add to the noise.
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


def estimate_floor(beside: Neighbours, scores: FrameScores, expected: Expectation) -> dict[str, tuple[float, int]]:
    """Sums and counts of a frame's scores by channel, as noise alone would make them.

    Args:
        beside: of the frame.
        scores, expected: as they are of.
    """
    gap, bright = np.minimum(np.abs(beside.gaps["range"][0]), CLIP_M), beside.gaps["intensity"][0]
    found = {"range": (float(gap.sum()) / 2, len(gap))}
    if len(bright):
        found["intensity"] = (float(np.abs(bright).sum()) / 2, len(bright))
    outcome = (~np.isnan(scores.measured_m)).astype(float)
    # Independent outcomes of one chance p differ with probability 2p(1 − p), twice the Brier score of saying p; those
    # of chances p and q do so by (p − q)² more.
    apart = np.abs(np.diff(outcome)) - np.diff(expected.seen) ** 2
    found["drop"] = (max(float(apart[beside.pair].sum()), 0.0) / 2, int(beside.pair.sum()))
    found["spurious"] = scores.foreseen, int((~scores.ambiguous).sum())
    return found

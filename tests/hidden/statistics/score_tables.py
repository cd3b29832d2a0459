"""Synthetic beams with scores and information in every channel, with or without an effect, and random effects.

Beams are spread over scans, sectors, and tracks of very different sizes, as static regions and objects are. Noise is
heavy-tailed, beams of one track may share an error that is fitted as a random effect, and beams may be a weighted
sample of more. Everything here is plain numpy; nothing of the diagnosis core is used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

MEANS, COUNTS, PROBABILITY, SPREADS = (
    ("range", "intensity"),
    ("spurious", "early", "late"),
    "drop",
    ("range_variance", "intensity_variance"),
)
SparseMatrix = Any  # scipy does not type products of its sparse matrices
CHANNELS = (*MEANS, *COUNTS, PROBABILITY, *SPREADS)
_EVENT_RATE, _RETURN = 4e-3, 0.93
_TRACK_ERROR = 0.15  # standard deviation of what the beams of a track share, in units of the noise


@dataclass(frozen=True, eq=False)
class Beams:
    """A weighted sample of beams.

    Attributes:
        track, scan, firing: (n,) int.
        azimuth: (n,) [rad].
        share: (n,) number of beams that each one represents.
    """

    track: np.ndarray
    scan: np.ndarray
    firing: np.ndarray
    azimuth: np.ndarray
    share: np.ndarray

    def __len__(self) -> int:
        return len(self.track)

    def sampled(self, rows: np.ndarray, weight: float) -> Beams:
        """Some of the beams, each of which represents `weight` times as many."""
        parts = (self.track[rows], self.scan[rows], self.firing[rows], self.azimuth[rows], self.share[rows] * weight)
        return Beams(*parts)


@dataclass(frozen=True, eq=False)
class Scores:
    """What residuals say about a change of a channel.

    Attributes:
        score: (n,) derivative of the log-likelihood with respect to the channel, weighted.
        information: (n,) expected information, weighted.
    """

    score: np.ndarray
    information: np.ndarray


def draw_beams(rng: np.random.Generator, count: int = 4000, tracks: int = 120, scans: int = 10) -> Beams:
    """Draw beams; sizes of tracks have a power-law distribution."""
    size = rng.pareto(1.2, tracks) + 0.2
    track = rng.choice(tracks, count, p=size / size.sum())
    firing = rng.integers(0, 300, count)
    azimuth = np.pi - 2 * np.pi * (firing + 0.5) / 300
    return Beams(track, rng.integers(0, scans, count), firing, azimuth, np.ones(count))


def draw_scores(
    rng: np.random.Generator, channel: str, beams: Beams, effect: np.ndarray | None = None, track_error: bool = False
) -> Scores:
    """Draw measurements of a channel and return their scores about the model without the effect.

    Args:
        rng: of everything random.
        channel: of `CHANNELS`.
        beams: n beams; their weights multiply score and information.
        effect: (n,) true change of the channel; None for none.
        track_error: whether beams of one track share an error that the model does not have.
    """
    n, change = len(beams), np.zeros(len(beams)) if effect is None else effect
    if channel in MEANS:
        noise = rng.standard_t(5, n) * (3 / 5) ** 0.5
        if track_error:
            noise = noise + _TRACK_ERROR * rng.normal(size=beams.track.max() + 1)[beams.track]
        return Scores(beams.share * (noise + change), beams.share.copy())
    if channel in COUNTS:  # in units of the expected share: score = events − expected
        is_event = rng.random(n) < _EVENT_RATE * (1 + np.maximum(change, -1))
        return Scores(beams.share * (is_event - _EVENT_RATE), beams.share * _EVENT_RATE)
    if channel == PROBABILITY:  # relative change of the probability of a return
        is_returned = rng.random(n) < np.clip(_RETURN * (1 + change), 0, 1)
        return Scores(beams.share * (is_returned - _RETURN) / (1 - _RETURN), beams.share * _RETURN / (1 - _RETURN))
    noise = rng.laplace(0, 2**-0.5, n) * np.exp(change)  # change of ln σ
    return Scores(beams.share * (np.minimum(noise**2, 20.0) - 1), 2 * beams.share)


def draw_basis(rng: np.random.Generator, beams: Beams, bins: int, by: str) -> SparseMatrix:
    """(n, bins) indicator functions of the bins of a covariate.

    Args:
        rng: of the covariate.
        beams: n beams.
        bins: number of bins.
        by: `beam` (each beam its own value), `track` (all beams of a track the same, as a material), `scan`, `azimuth`.
    """
    if by == "beam":
        index = rng.integers(0, bins, len(beams))
    elif by == "azimuth":
        turn = beams.azimuth + rng.uniform(0, 2 * np.pi)
        index = (np.mod(turn, 2 * np.pi) / (2 * np.pi) * bins).astype(int)
    else:
        unit = getattr(beams, by)
        index = rng.integers(0, bins, int(unit.max()) + 1)[unit]
    return sparse.csr_matrix((np.ones(len(beams)), (np.arange(len(beams)), index)), (len(beams), bins))


def correlated_basis(rng: np.random.Generator, basis: SparseMatrix, kept: float) -> SparseMatrix:
    """Bins of a covariate that agrees with another one for a share of the beams and is random for the others."""
    index = np.asarray(basis.argmax(1)).ravel()
    other = rng.integers(0, basis.shape[1], len(index))
    index = np.where(rng.random(len(index)) < kept, index, other)
    return sparse.csr_matrix((np.ones(len(index)), (np.arange(len(index)), index)), basis.shape)


def track_effects(beams: Beams) -> SparseMatrix:
    """(n, tracks) columns of one random effect per track."""
    shape = (len(beams), int(beams.track.max()) + 1)
    return sparse.csr_matrix((np.ones(len(beams)), (np.arange(len(beams)), beams.track)), shape)


def quadratic_likelihood(
    scores: Scores,
    columns: np.ndarray,
    coefficients: np.ndarray,
    random_columns: np.ndarray,
    precision: np.ndarray,
    fitted: np.ndarray,
) -> float:
    """Quadratic log-likelihood of a change of the columns, maximised over changes of the random effects.

    ℓ(θ) = maxᵤ Σ sᵢdᵢ − ½ Σ wᵢdᵢ² − ½ (û + u)ᵀΛ(û + u) with d = Xθ + Zu: the definition that efficient scores and Gram
    matrices must agree with.

    Args:
        scores: of the n beams.
        columns: (n, k) X.
        coefficients: (k,) θ.
        random_columns: (n, a) Z.
        precision: (a,) diagonal of Λ.
        fitted: (a,) û.
    """
    s, w, x = scores.score, scores.information, columns @ coefficients
    curvature = random_columns.T @ (w[:, None] * random_columns) + np.diag(precision)
    change = np.linalg.solve(curvature, random_columns.T @ (s - w * x) - precision * fitted)
    d, u = x + random_columns @ change, fitted + change
    return float(s @ d - 0.5 * w @ d**2 - 0.5 * precision @ u**2)

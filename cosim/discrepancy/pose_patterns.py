"""What fitted pose errors say of candidates that would make such errors, as a suspension or a late clock does.

Scan by scan nothing tells a turn of the vehicle from an error of its pose: every trace of it in the ranges goes once
poses are fitted. From scan to scan it does: errors that follow the acceleration or the speed are no chance. With poses
as random effects N(0, Σ) the slope of the likelihood, poses integrated out, is Σ q·Σ⁻¹·p over scans, where p are the
fitted errors and q those that a unit of the candidate would make. So p is regressed on q, each scan one fact, fewer
where what is left drifts; the deviate is Student's. That the scans it rests on are not a few that are off by chance is
asked of signed permutations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from cosim.discrepancy.gate import Direction, Posed
from cosim.discrepancy.inference.fit import POSE_FLOOR, Fitted, Fitter
from cosim.discrepancy.inference.pose_errors import independent_share
from cosim.discrepancy.inference.wild_bootstrap import DRAWS

_RIGID = 0.5  # share of a candidate's changes of ranges that pose errors could make
_VARIED = 0.05  # share of its pattern that differs from scan to scan
_STEADY = 0.1  # share of an amplitude by which scans may differ: a pattern that all have alike is else a drift's, too
FEWEST_SCANS = 4  # that pose errors are compared from
_MOST_DEVIATE = 12.0
_REWEIGHTED, _WIDE = 8, 3.0
_MATTERS = 2.0  # times the least spread must be what errors follow
_CLOSE = 1e-3  # standard deviations


@dataclass(frozen=True)
class Agreement:
    """How well errors (scans, k) follow a pattern.

    Attributes:
        amplitude, error: of the pattern in the errors, and its standard error.
        deviate: equivalent standard normal deviate, of the amplitude's sign.
        p_value: share of signed permutations that agree as well.
        is_steady: whether every scan has about the same amplitude, as no drift would.
    """

    amplitude: float
    error: float
    deviate: float
    p_value: float
    is_steady: bool


class PosePatterns:
    """Candidates as patterns of pose errors.

    Args:
        fitter, fitted: the model as it stands.
    """

    def __init__(self, fitter: Fitter, fitted: Fitted) -> None:
        self._fitted, self._sample = fitted, fitter.sample
        self._poses = fitter.slopes(fitted.pose, fitted.prediction)
        self._weight = _weights(fitted)

    def of(self, directions: Sequence[Direction], rng: np.random.Generator) -> list[Posed]:
        """What pose errors say of those of the directions that act through poses."""
        pose, sigma = self._fitted.pose, self._fitted.pose_sigma
        found = []
        for direction in directions:
            pattern = self.pattern(direction)
            if pattern is None:
                continue
            told = agreement(pose / sigma, pattern / sigma, POSE_FLOOR / sigma, rng)
            if told is not None and (told.is_steady or not _is_constant(pattern / sigma)):
                unit = (pattern / sigma).ravel()
                unit = unit / np.linalg.norm(unit)
                found.append(Posed(direction, told.deviate, told.p_value, told.error, unit))
        return found

    def rigid(self, directions: Sequence[Direction]) -> set[str]:
        """Names of effects that move whole scans, as errors of their poses do."""
        return {direction.effect for direction in directions if self.pattern(direction) is not None}

    def pattern(self, direction: Direction) -> np.ndarray | None:
        """Pose errors (scans, 6) that a unit of a direction makes; None where it does something else."""
        delta, weight = direction.moved, self._weight
        if direction.column.rings > 1 or delta is None or self._sample.own_axes:
            return None
        scans = self._fitted.pose.shape[0]
        pattern, explained, total = np.zeros((scans, 6)), 0.0, 0.0
        for scan in range(scans):
            mine = np.flatnonzero(self._sample.frame == scan)
            basis = self._poses[mine][:, 6 * scan : 6 * scan + 6].toarray() * POSE_FLOOR
            made, used = followed(basis, delta[mine], weight[mine])
            pattern[scan] = made * POSE_FLOOR
            explained += float(used @ (basis @ made) ** 2)
            total += float(used @ delta[mine] ** 2)
        return pattern if total > 0 and explained > _RIGID * total else None


def followed(basis: np.ndarray, delta: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (k,) by which columns (n, k) make most of the changes (n,), and the weights that these got at last.

    Vehicles that move by themselves are no part of what a pose does, and ranges along their sides change most of all.
    """
    used = weight
    for _ in range(_REWEIGHTED):
        made = np.linalg.lstsq((basis.T * used) @ basis, basis.T @ (used * delta), rcond=1e-9)[0]
        apart = np.abs(delta - basis @ made)
        middle = float(np.median(apart[weight > 0])) if np.any(weight > 0) else 0.0
        used = weight / (1 + (apart / max(_WIDE * middle, 1e-9)) ** 2)
    return made, used


def _weights(fitted: Fitted) -> np.ndarray:
    """(n,) weights by which fitted pose errors are what they are: residuals beyond noise hardly count."""
    fit, evidence = fitted.fit, fitted.evidence
    away = np.abs(fit.range_z) > _CLOSE
    residual = np.where(away, fit.range_z, 1.0) * fit.range_sigma_m
    return np.where(away, evidence.score["range"] / residual, evidence.information["range"])


def agreement(errors: np.ndarray, pattern: np.ndarray, floor: np.ndarray, rng: np.random.Generator) -> Agreement | None:
    """Regress errors (scans, k) in units of their spread on a pattern of the same shape.

    Args:
        errors: fitted.
        pattern: those that a unit makes.
        floor: (k,) how small errors may be that nothing is to be made of.
        rng: for the permutations.
    """
    size = np.linalg.norm(pattern, axis=1)
    acts = size > 1e-6 * size.max(initial=0.0)
    if np.count_nonzero(acts) < FEWEST_SCANS:
        return None
    weight, along = size[acts], (errors * pattern).sum(1)[acts] / size[acts]
    total = float(weight @ weight)
    amplitude = float(weight @ along) / total
    left = along - amplitude * weight
    share, freedom = _share(left), len(weight) - 1
    least = float(((floor * pattern[acts]) ** 2).sum()) / total
    error = float(np.sqrt((float(left @ left) / (freedom * share) + least) / total))
    tail = float(stats.t.logsf(abs(amplitude) / error, max(freedom * np.sqrt(share), 2.0)))
    matters = np.sqrt((pattern**2).mean(0)) * abs(amplitude) > _MATTERS * floor
    deviate = min(_deviate(tail), _MOST_DEVIATE) if matters.any() else 0.0
    order = np.argsort(rng.random((DRAWS, len(errors))), axis=1)
    signs = rng.choice((-1.0, 1.0), order.shape)
    drawn = np.einsum("dsk,sk,ds->d", errors[order], pattern, signs)
    beyond = np.count_nonzero(np.abs(drawn) >= abs(float((errors * pattern).sum())) * (1 - 1e-12))
    steady = bool(np.all(np.abs(left) < _STEADY * np.abs(amplitude) * weight))
    return Agreement(amplitude, error, float(np.sign(amplitude)) * deviate, (1 + beyond) / (1 + DRAWS), steady)


def _share(left: np.ndarray) -> float:
    """How many facts each residual is; autocorrelations of short series come out too low by (1 + 3ρ)/n (Kendall)."""
    share = independent_share(left[:, None])
    likeness = (1 - share) / (1 + share)
    likeness = min(likeness + (1 + 3 * likeness) / len(left), 0.95)
    return (1 - likeness) / (1 + likeness)


def _deviate(log_tail: float) -> float:
    """Standard normal deviate of a one-sided tail probability given by its logarithm."""
    if log_tail > -600:
        return float(stats.norm.isf(np.exp(log_tail)))
    return float(np.sqrt(-2 * log_tail))


def _is_constant(pattern: np.ndarray) -> bool:
    mean = pattern.mean(0)
    return float(((pattern - mean) ** 2).sum()) < _VARIED * float((pattern**2).sum())

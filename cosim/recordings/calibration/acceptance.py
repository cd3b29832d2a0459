"""Acceptance of a calibration: recommended only if the error of held-out scans falls significantly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.discrepancy.diagnosis import Diagnosis
from cosim.recordings.calibration.held_out import LEAST_FALL, Change, Scores, change_between, read_scores
from cosim.recordings.calibration.rounds import Round
from cosim.recordings.mapping.correction import moves_points
from cosim.recordings.mapping.odometry import Trajectory

SCORES = "held_out.npz"  # of each round: models `given` and `accepted`
_SHORT_M = 10.0  # length of path on which few surfaces are seen at different ranges
_ONE_SPEED = 0.05  # spread of speeds relative to their mean
_STRAIGHT_DEG = 5.0  # range of headings


@dataclass(frozen=True)
class Transfer:
    """Change of the error of held-out scans by a finding.

    Attributes:
        effect: its name.
        change, low, high: of the aligned error, with its 95 % interval; null where there are too few scans.
        by: `step` where it was added on the same map, `map` where its map was compared with the one before.
        is_accepted: whether it is in the recommended file if that is recommended at all.
        round: the round that found it.
    """

    effect: str
    change: float | None
    low: float | None
    high: float | None
    by: str
    is_accepted: bool
    round: int = 0


@dataclass(frozen=True)
class Acceptance:
    """Recommendation.

    Attributes:
        is_recommended: whether the calibrated file is better than the one that the calibration began with.
        round: whose accepted file it is; 0 where the first file is kept.
        change: of the error of held-out scans from the first file to the recommended one, or to that of the last
            round where none is; None where it cannot be measured.
        reason: a sentence.
        transfers: of every finding, in order.
    """

    is_recommended: bool
    round: int
    change: Change | None
    reason: str
    transfers: tuple[Transfer, ...]

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def step_transfers(diagnosis: Diagnosis) -> list[Transfer]:
    """Change of the error of held-out scans by each finding of a round, on the round's own map.

    A finding that moves points stays in any case: what it does shows in the next map, see `accept`.
    """
    transfers = []
    for one in diagnosis.changes:
        low, high = one.mean - one.half_interval, one.mean + one.half_interval
        known = bool(np.isfinite(one.half_interval))
        falls = known and high < 0
        values = (one.mean, low, high) if known else (None, None, None)
        transfers.append(Transfer(one.name, *values, "step", falls or moves_points(one.name)))
    return transfers


def accept(folder: Path, rounds: Sequence[Round]) -> Acceptance:
    """Choose a round whose accepted file has the least error of held-out scans, if any error falls beyond doubt.

    Of the rounds whose intervals include the largest fall, the last one is chosen: its map is the best.

    Args:
        folder: of the calibration.
        rounds: in order.
    """
    scores = [read_scores((folder / one.sensor_out).parent / SCORES) for one in rounds]
    given = scores[0]["given"]
    changes = [change_between(given, one["accepted"]) for one in scores]
    transfers = tuple(_transfers(rounds, scores))
    better = [
        (one, change) for one, change in zip(rounds, changes, strict=True) if change is not None and change.is_fall
    ]
    if better:
        least = min(change.mean for _, change in better)
        chosen, change = next(pair for pair in reversed(better) if pair[1].low <= least)
        reason = (
            f"the error of {change.scans} held-out scans falls by {_interval(-change.mean, -change.high, -change.low)}"
        )
        return Acceptance(True, chosen.number, change, reason, transfers)
    return Acceptance(False, 0, changes[-1], _why_not(changes[-1], rounds), transfers)


def _transfers(rounds: Sequence[Round], scores: Sequence[dict[str, Scores]]) -> list[Transfer]:
    """Acceptance of each finding; those that move points are also validated on the next map."""
    found = []
    for number, one in enumerate(rounds):
        later = (
            change_between(scores[number]["given"], scores[number + 1]["given"]) if number + 1 < len(rounds) else None
        )
        for row in one.transfers:
            transfer = Transfer(**{**row, "round": one.number})
            if later is not None and moves_points(transfer.effect) and not (transfer.high or 0.0) < 0:
                transfer = replace(
                    transfer, change=later.mean, low=later.low, high=later.high, by="map", is_accepted=later.is_fall
                )
            elif moves_points(transfer.effect):
                transfer = replace(transfer, is_accepted=bool(transfer.high is not None and transfer.high < 0))
            found.append(transfer)
    return found


def _why_not(change: Change | None, rounds: Sequence[Round]) -> str:
    if not any(one.findings or one.unknowns for one in rounds):
        return "no effect is missing from your file"
    if change is None:
        message = "too few held-out scans can be compared (three are needed): record thirty scans or more"
    elif change.low > 0:
        message = (
            f"the error of {change.scans} held-out scans rises by {_interval(change.mean, change.low, change.high)}"
        )
    elif change.high < 0:
        message = f"the error of {change.scans} held-out scans falls by less than {100 * LEAST_FALL:.1f} %"
    else:
        message = (
            f"the error of {change.scans} held-out scans changes by "
            f"{_interval(change.mean, change.low, change.high)}, which includes no change"
        )
    limits = rounds[-1].limits
    return f"{message}; the drive {', '.join(limits)}" if limits else message


def path_limits(path: Trajectory) -> list[str]:
    """Quantities that a path does not vary, as predicates of the drive."""
    if path.standing:
        return [f"does not move ({path.extent_m:.2f} m)"]
    limits = []
    if path.path_m < _SHORT_M:
        limits.append(f"is {path.path_m:.1f} m long, so that few surfaces are seen from near and far")
    step = np.linalg.norm(path.motion[:, 3:], axis=1)
    if len(step) > 2 and np.std(step) < _ONE_SPEED * np.mean(step):
        limits.append("has one speed")
    heading = np.unwrap(np.arctan2(path.poses[:, 1, 0], path.poses[:, 0, 0]))
    if np.degrees(np.ptp(heading)) < _STRAIGHT_DEG:
        limits.append("is straight")
    return limits


def _interval(value: float, low: float, high: float) -> str:
    return f"{value:.3f} ({low:.3f} to {high:.3f})"

"""Errors common to the beams of a unit: a firing, a packet, a sector, a scan, a block or ring in a scan.

The variance of a common error has the score ½ Σ aᵢaⱼ over pairs of beams of one unit, a the scores of the quantity, and
the information ½ Σ IᵢIⱼ. Pairs that hit the same object or map cell are excluded, because a misplaced surface
correlates them too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.inference.dependence import ANGLES
from cosim.discrepancy.sampling.sample import Sample
from sensors.effects.shared_errors import PACKET_FIRINGS, SECTORS

_WIDEST = 0.999  # quantile of scores to which larger ones are clipped


@dataclass(frozen=True, eq=False)
class SharedError:
    """Variance of an error that is common to the beams of each unit.

    Attributes:
        group: group with the score and information of each beam's part.
        unit: (n,) int unit of each beam.
        weighted: information times the mean weight of the beams, the variance of the score.
    """

    group: Group
    unit: np.ndarray
    weighted: float


def shared_errors(linearisation: Linearisation) -> list[SharedError]:
    """Build the groups of all shared errors.

    Not tested: angles shared by a scan, a block or a ring in it, which are errors of poses.

    Args:
        linearisation: linearised model.
    """
    sample, found = linearisation.sample, []
    usable = sample.clear & sample.first
    has_poses = linearisation.fitter.random.has_poses
    for channel in ("range", *ANGLES, "intensity", "drop"):
        if channel not in linearisation.channels:
            continue
        score, information = (np.where(usable, values, 0.0) for values in linearisation.weights(channel))
        if not information.any():
            continue
        score = score - information * (score.sum() / information.sum())  # a common mean is no shared error
        most = float(np.quantile(np.abs(score[information > 0]), _WIDEST))
        score = np.clip(score, -most, most)
        for name, unit in unit_codes(linearisation).items():
            if channel in ANGLES and (name in ("block", "ring") or (name == "scan" and has_poses)):
                continue
            found.append(_shared_error(channel, name, unit, sample, score, information))
    return found


def unit_codes(linearisation: Linearisation) -> dict[str, np.ndarray]:
    """(n,) int unit of each beam, by kind of unit."""
    sample = linearisation.sample
    firings = int(sample.firing.max(initial=0)) + 1
    codes = {
        "firing": sample.frame * firings + sample.firing,
        "packet": sample.frame * firings + sample.firing // PACKET_FIRINGS,
        "sector": sample.frame * SECTORS + sample.firing * SECTORS // firings,
        "scan": sample.frame,
        "ring": sample.frame * (int(sample.ring.max(initial=0)) + 1) + sample.ring,
    }
    if len(np.unique(sample.block)) > 1:
        codes["block"] = sample.frame * 2 + sample.block
    return codes


def common_information(first: SharedError, second: SharedError, information: np.ndarray, sample: Sample) -> float:
    """Information common to the variances of two units: from the pairs of beams that are in both.

    Args:
        first, second: shared errors of the same channel.
        information: (n,) information of that channel.
        sample: the beams.
    """
    both = np.unique(_combine_codes(first.unit, second.unit), return_inverse=True)[1]
    own = np.unique(_combine_codes(both, sample.track), return_inverse=True)[1]
    squares = (np.bincount(both, information) ** 2).sum() - (np.bincount(own, information) ** 2).sum()
    return 0.5 * float(squares)


def _shared_error(
    channel: str,
    name: str,
    unit: np.ndarray,
    sample: Sample,
    score: np.ndarray,
    information: np.ndarray,
) -> SharedError:
    unit = np.unique(unit, return_inverse=True)[1]
    own = np.unique(_combine_codes(unit, sample.track), return_inverse=True)[1]

    def others(values: np.ndarray) -> np.ndarray:
        return np.bincount(unit, values)[unit] - np.bincount(own, values)[own]

    variance = information * sample.share
    group = Group(
        f"shared_{channel} by {name}",
        f"shared_{channel}",
        (name,),
        1,
        one_sided=True,
        direct=(0.5 * score * others(score), 0.5 * information * others(information)),
    )
    return SharedError(group, unit, 0.5 * float(variance @ others(variance)))


def _combine_codes(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Combine pairs of codes (n,) to one code (n,)."""
    return first.astype(np.int64) * (int(second.max(initial=0)) + 1) + second

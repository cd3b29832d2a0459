"""Errors common to the beams of a unit: a firing, a packet, a sector, a scan, a block or ring in a scan.

The variance v of a common error has the score ½ Σ w aᵢaⱼ over pairs of beams of one unit, a the scores of the quantity,
and the information ½ Σ w IᵢIⱼ. The weight of a unit, w = 1/(1 + v I)² with a first estimate of v and the information I
of the unit about its error, is that of the efficient score: a unit of many beams says little more about v than one of a
few. Pairs that hit the same object or map cell are excluded, because a misplaced surface correlates them too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cosim.discrepancy.dictionary.groups import Group
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.inference.dependence import ANGLES
from cosim.discrepancy.sampling.sample import Sample
from sensors.effects.shared_errors import PACKET_FIRINGS, SECTORS

_EMPTY = Group("", "", (), 0)
_WIDEST = 0.999  # quantile of scores to which larger ones are clipped


@dataclass(frozen=True, eq=False)
class SharedError:
    """Variance of an error that is common to the beams of each unit.

    Attributes:
        group: group with the score and information of each beam's part.
        unit: (n,) int unit of each beam.
        pairs: (n,) each beam's part of the sum of IᵢIⱼ over the pairs of its unit.
        variance: first estimate of the variance.
        weighted: information times the mean weight of the beams, the variance of the score.
    """

    group: Group
    unit: np.ndarray
    pairs: np.ndarray
    variance: float
    weighted: float

    @cached_property
    def weight(self) -> np.ndarray:
        """(n,) weight of each beam's unit."""
        return 1 / (1 + self.variance * self.of_unit) ** 2

    @cached_property
    def of_unit(self) -> np.ndarray:
        """(n,) information of each beam's unit about its error, from pairs."""
        return np.sqrt(np.bincount(self.unit, self.pairs)[self.unit])

    def gain(self, score: np.ndarray, variance: np.ndarray) -> np.ndarray:
        """Each beam's part (n,) of the gain in log-likelihood of a variance v: ½ Σᵤ [v S²/(1 + v I) − ln(1 + v I)].

        I is the information of a unit about its error. S², the square of the sum of its beams' scores, is twice the
        score of the pairs of different surfaces, plus I for single beams.

        Args:
            score: (n,) scores of the variance, as in the group.
            variance: (n,) variance of the errors.
        """
        known = self.of_unit > 0
        of_unit = np.where(known, self.of_unit, 1.0)
        share = np.where(known, self.pairs / of_unit**2, 0.0)
        square = 2 * score / self.weight + share * of_unit
        gain = 0.5 * (variance * square / (1 + variance * of_unit) - share * np.log1p(variance * of_unit))
        return np.where(known, gain, 0.0)


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
    """Expected score of the first variance per unit of the second one: from the pairs of beams that are in both units.

    Args:
        first, second: shared errors of the same quantity.
        information: (n,) information about the changes of both channels together.
        sample: the beams.
    """
    information = information * np.sqrt(first.weight)  # may be negative
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

    pairs, products = information * others(information), score * others(score)
    total = float(pairs.sum())
    variance = max(float(products.sum()) / total, 0.0) if total > 0 else 0.0
    of_score = information * sample.share
    found = SharedError(_EMPTY, unit, pairs, variance, 0.0)
    weighted = 0.5 * float((found.weight**2 * of_score) @ others(of_score))
    group = Group(
        f"shared_{channel} by {name}",
        f"shared_{channel}",
        (name,),
        1,
        one_sided=True,
        direct=(0.5 * found.weight * products, 0.5 * found.weight * pairs),
    )
    return replace(found, group=group, weighted=weighted)


def _combine_codes(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Combine pairs of codes (n,) to one code (n,)."""
    return first.astype(np.int64) * (int(second.max(initial=0)) + 1) + second

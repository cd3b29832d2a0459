"""Losses at the ends of surfaces of a map that was made from the scans.

A map of points ends within a cell of where the real surfaces do, and says nothing of what is beyond. Near the end of a
surface a beam may miss it. If another surface is behind, the beam returns from that one and is not compared; before the
sky it does not return, as if the sensor had lost it.

Where a map ends, each of its surfaces is therefore either met by all its beams, or by an unknown share of them, for
which any value between 0 and 1 is equally likely. The share of such surfaces is estimated. Losses by the sensor occur
on all surfaces, so that those away from the ends show them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import betaln

from cosim.discrepancy.inference.mixture import mixture_weights
from cosim.discrepancy.sampling.sample import Sample


@dataclass(frozen=True, eq=False)
class MapEnds:
    """Which of n beams certainly meet the surfaces of their rows.

    Attributes:
        met: (n,) posterior probability that all beams of the surface meet it.
        loglik: (n,) change of the log-likelihood of each beam.
    """

    met: np.ndarray
    loglik: np.ndarray

    @classmethod
    def of(cls, sample: Sample, chance: np.ndarray) -> MapEnds | None:
        """Estimate from returns and losses; None without beams at the end of a map.

        Args:
            sample: sample of measured beams.
            chance: (n,) probability of what was observed of each beam, a return or none, if it meets its surface.
        """
        rows = np.flatnonzero(sample.compared & sample.at_end & (sample.surface >= 0))
        if not len(rows):
            return None
        surface, beams = np.unique(sample.surface[rows], return_inverse=True)
        count = np.bincount(beams)
        returned = np.bincount(beams, sample.returned[rows])
        all_met = np.bincount(beams, np.log(chance[rows]))
        some_met = betaln(returned + 1, count - returned + 1)  # the integral over all shares
        top = np.maximum(all_met, some_met)
        parts = np.exp(all_met - top), np.exp(some_met - top)[None]
        share = mixture_weights(*parts, np.ones(len(surface)), sample.settings.likelihood)[0]
        likelihood = (1 - share) * parts[0] + share * parts[1][0]
        met, loglik = np.ones(len(sample)), np.zeros(len(sample))
        met[rows] = ((1 - share) * parts[0] / likelihood)[beams]
        loglik[rows] = ((top + np.log(likelihood) - all_met) / count)[beams]
        return cls(met, loglik)

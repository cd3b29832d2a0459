"""Weights of a mixture of components with known likelihoods."""

from __future__ import annotations

import numpy as np

from cosim.discrepancy.settings import LikelihoodConstants


def mixture_weights(
    rest: np.ndarray, others: np.ndarray, weight: np.ndarray, constants: LikelihoodConstants
) -> np.ndarray:
    """Maximum-likelihood weights (c,) of mixture components, by Newton's method with a lower limit.

    The log-likelihood is concave. The EM algorithm needs thousands of steps where a weight is near zero, and stops too
    early there. At the maximum, derivatives of the likelihood with respect to other parameters are as for known
    weights.

    Args:
        rest: (k,) likelihoods of the component with the remaining weight.
        others: (c, k) likelihoods of the components.
        weight: (k,) weights of the beams.
        constants: settings of the likelihood.
    """
    least, slope = constants.neither_tolerance, others - rest
    share = np.full(len(others), constants.neither_share)
    density = rest + share @ slope
    change = np.inf
    while change > least:
        ratio = slope / density
        if not np.isfinite(ratio).all():  # an unphysical trial: its likelihood is not finite either way
            break
        gradient, information = ratio @ weight, (ratio * weight) @ ratio.T
        free = (share > least) | (gradient > 0)
        step = np.zeros(len(share))
        step[free] = np.linalg.lstsq(information[np.ix_(free, free)], gradient[free], rcond=None)[0]
        change = np.inf
        while change > least:  # half the step until the likelihood rises
            moved = np.maximum(share + step, least)
            moved *= min(1.0, (1 - least) / moved.sum())
            there = rest + moved @ slope
            change = float(np.abs(moved - share).max())
            if weight @ np.log(there / density) >= 0:
                share, density = moved, there
                break
            step /= 2
    return share

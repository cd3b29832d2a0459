"""Weights of a mixture of components with known likelihoods."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from cosim.discrepancy.settings import LikelihoodConstants

_NEGLIGIBLE_GAIN = 1e-9  # expected gain in log-likelihood below which the search ends
_DAMPING = 1e-9  # of the information about each weight: components may be equal


def mixture_weights(
    rest: np.ndarray, others: np.ndarray, weight: np.ndarray, constants: LikelihoodConstants
) -> np.ndarray:
    """Maximum-likelihood weights (c,) of mixture components, none below a minimum, by sequential quadratic programming.

    The log-likelihood is concave and self-concordant: Newton's steps within the limits of the weights, halved until
    the likelihood rises, converge from any start. The EM algorithm needs thousands of steps where a weight is near
    zero, and stops too early there. At the maximum, derivatives of the likelihood with respect to other parameters are
    as for known weights.

    Args:
        rest: (k,) likelihoods of the component with the remaining weight.
        others: (c, k) likelihoods of the components.
        weight: (k,) weights of the beams.
        constants: settings of the likelihood.
    """
    components, total = np.vstack([rest, others]), weight.sum()
    least = constants.least_neither_share
    above = 1 - least * len(components)  # what remains after each component has its minimum
    likelihood = above * components + least * components.sum(axis=0)
    share = np.full(len(components), 1 / len(components))
    density = share @ likelihood
    while True:
        ratio = likelihood / density
        if not np.isfinite(ratio).all():  # an unphysical trial: its likelihood is not finite either way
            break
        gradient, information = ratio @ weight - total, (ratio * weight) @ ratio.T
        step = _best_share(gradient, information, share) - share
        expected_gain = gradient @ step
        if not expected_gain > _NEGLIGIBLE_GAIN:
            break
        there = (share + step) @ likelihood
        while weight @ np.log(there / density) < 0 and expected_gain > _NEGLIGIBLE_GAIN:
            step, expected_gain = step / 2, expected_gain / 2
            there = (share + step) @ likelihood
        share, density = share + step, there
    return above * share[1:] / share.sum() + least


def _best_share(gradient: np.ndarray, information: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Weights ≥ 0 where the quadratic approximation of the log-likelihood, less the weight of all beams times the sum
    of the weights, has its maximum.

    The second term makes this sum 1, because twofold weights multiply the likelihood of each beam by 2 (Kim et al.
    2020, "A fast algorithm for maximum likelihood estimation of mixture proportions").
    """
    root = np.linalg.cholesky(information * (1 + _DAMPING * np.eye(len(share))))
    return nnls(root.T, share @ root + np.linalg.solve(root, gradient))[0]

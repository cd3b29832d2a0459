"""How wide noise is, told by how neighbours differ: what both share is an error of the twin or the mean, no noise."""

from __future__ import annotations

import numpy as np

from cosim.discrepancy.data.sample import Sample
from cosim.discrepancy.inference.likelihood import Fit
from cosim.discrepancy.inference.score import MOST_SQUARED


def quasi_likelihood(sample: Sample, fit: Fit) -> np.ndarray:
    """(n,) −½d² − log σ of each beam, d the difference from its neighbour over σ√2 (Wedderburn, Biometrika 1974).

    Its maximum is the standard deviation of the noise, whatever law that follows; the likelihood of a Student-t has it
    elsewhere for noise that is none.
    """
    pair = np.maximum(sample.partner, 0)
    found = np.zeros(len(sample))
    for z, clean, sigma in (
        (fit.range_z, fit.matched, fit.range_sigma_m),
        (fit.intensity_z, fit.bright * fit.whole * ~sample.seam, fit.intensity_sigma),
    ):
        both = sample.share * clean * clean[pair] * (sample.partner >= 0)
        gap = np.minimum((z - z[pair]) ** 2 / 2, MOST_SQUARED)
        found += both * (-0.5 * gap - np.log(np.maximum(sigma, 1e-9)))
    return found

"""How far the labels of objects are off, as their points show, and what cannot be told then.

Every object's range residuals share a mean, which a label that is off makes. Where these means scatter more than noise
lets them, ranges on objects are so much less sure, and beside their silhouettes nobody knows what a beam should meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cosim.discrepancy.fitting import Fitted, Fitter
from cosim.discrepancy.frames import TracedFrame

_FEWEST_BEAMS, _FEWEST_OBJECTS = 5, 10
_LEAST_M, _NEAR_M = 0.005, 0.5
_OF_NORMAL = 1.4826  # standard deviations a median size of deviates
_STEEPEST = 0.2
_SIGMAS = 2.5
_WORTH = 0.25
_MOST_FIRINGS = 60


def label_scatter_m(frames: Sequence[TracedFrame], fitter: Fitter, fitted: Fitted) -> float:
    """Standard deviation [m] of labels across the surfaces that were met; 0 where noise explains what there is.

    Args:
        frames: that the fitter's sample is of.
        fitter, fitted: a fit.
    """
    sample, fit = fitter.sample, fitted.fit
    if any(np.any((frame.exact or frame).unsure_m > 0) for frame in frames):
        return 0.0  # the twin says itself how sure it is
    residual = fit.range_z * fit.range_sigma_m
    used = np.flatnonzero((sample.instance >= 0) & sample.returned & sample.compared & (np.abs(residual) < _NEAR_M))
    across = sample.cos_incidence[used]
    key = sample.frame[used].astype(np.int64) * (int(sample.instance.max(initial=0)) + 1) + sample.instance[used]
    group, count = np.unique(key, return_inverse=True, return_counts=True)[1:]
    mean = np.bincount(group, residual[used] * across) / count
    noise = np.bincount(group, (fitted.prediction.range_sigma_m[used] * across) ** 2) / count**2
    told = count >= _FEWEST_BEAMS
    if np.count_nonzero(told) < _FEWEST_OBJECTS:
        return 0.0
    scatter = _OF_NORMAL * float(np.median(np.abs(mean[told])))
    excess = scatter**2 - float(np.median(noise[told]))
    return float(np.sqrt(excess)) if excess > _LEAST_M**2 else 0.0


def differs(scatter_m: float, known_m: float) -> bool:
    """Whether two scatters of labels [m] are worth a fit anew."""
    return abs(scatter_m - known_m) > _WORTH * max(scatter_m, known_m)


def with_unsure_labels(frames: Sequence[TracedFrame], scatter_m: float) -> list[TracedFrame]:
    """Frames whose labels are off by so much [m], or exact."""
    return [_unsure(frame.exact or frame, scatter_m) for frame in frames]


def _unsure(frame: TracedFrame, scatter_m: float) -> TracedFrame:
    if scatter_m <= 0:
        return frame
    solid, traced = frame.shot.hits.solid, frame.shot.traced
    assert traced is not None  # frames are traced
    steep = np.abs(np.einsum("ij,ij->i", solid.normal, traced.direction))
    along = np.where(solid.instance >= 0, scatter_m / np.maximum(steep, _STEEPEST), 0.0)
    edge = frame.edge | _beside_objects(frame, _SIGMAS * scatter_m)
    unsure = np.hypot(frame.unsure_m, along).astype(np.float32)
    return replace(frame, unsure_m=unsure, edge=edge, label_scatter_m=scatter_m, exact=frame)


def _beside_objects(frame: TracedFrame, reach_m: float) -> np.ndarray:
    """(n,) bool: beams that pass within a reach [m] of where an object begins or ends, along their ring."""
    solid, rays = frame.shot.hits.solid, frame.shot.rays
    beams = len(rays)
    here, after = slice(0, beams - 1), slice(1, beams)
    begins = (solid.instance[here] != solid.instance[after]) & (rays.ring[here] == rays.ring[after])
    begins &= (solid.instance[here] >= 0) | (solid.instance[after] >= 0)
    rows = np.flatnonzero(begins)
    # The nearer of the two is what covers the other.
    near = np.minimum(*(np.where(solid.exists[r], solid.range_m[r], np.inf) for r in (rows, rows + 1)))
    step = np.abs(np.angle(np.exp(1j * (rays.azimuth[rows + 1] - rays.azimuth[rows]).astype(np.float64))))
    reach = np.ceil(np.minimum(reach_m / np.maximum(near * step, 1e-6), _MOST_FIRINGS)).astype(int)
    change = np.zeros(beams + 1, int)
    np.add.at(change, np.maximum(rows + 1 - reach, 0), 1)
    np.add.at(change, np.minimum(rows + 1 + reach, beams), -1)
    return np.cumsum(change[:-1]) > 0

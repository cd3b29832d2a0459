"""How far a twin is off, as points show, and what cannot be told then.

Every object's range residuals share a mean, which a label that is off makes; so do those of a spot of the map, in
every scan that sees it. Where these means scatter more than noise lets them, ranges are so much less sure, and beside
the silhouettes of objects nobody knows what a beam should meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cosim.discrepancy.data.frames import Scatter, TracedFrame
from cosim.discrepancy.data.sample import CELL_M, Sample
from cosim.discrepancy.inference.fit import Fitted, Fitter
from sensors.hits import STATIC

_FEWEST_BEAMS, _FEWEST_GROUPS = 5, 10
_LEAST_M, _NEAR_M, _NEAR_ON_MAP_M = 0.005, 0.5, 3.0
_OF_NORMAL = 1.4826  # standard deviations a median size of deviates
_STEEPEST, _STEEPEST_OF_MAP = 0.2, 0.02
_SIGMAS = 2.5
_WORTH = 0.25
_MOST_FIRINGS = 60
_ASIDE, _REACHES = 8, (0.4, 1.0)


def measured_scatter(frames: Sequence[TracedFrame], fitter: Fitter, fitted: Fitted) -> Scatter:
    """How far labels are off, and the map, where frames say already that it is; 0 where noise explains what there is.

    Args:
        frames: that the fitter's sample is of.
        fitter, fitted: a fit.
    """
    if _says_itself(frames):
        return Scatter()
    sample = fitter.sample
    of_labels = sample.frame.astype(np.int64) * (int(sample.instance.max(initial=0)) + 1) + sample.instance
    labels_m = _scatter_m(sample, fitted, sample.instance >= 0, of_labels, _NEAR_M)
    return Scatter(labels_m, map_scatter_m(frames, fitter, fitted) if frames[0].scatter.map_m > 0 else 0.0)


def map_scatter_m(frames: Sequence[TracedFrame], fitter: Fitter, fitted: Fitted) -> float:
    """How far spots of the map are off [m] across their surfaces, if nothing but that and noise is the matter."""
    sample = fitter.sample
    if _says_itself(frames):
        return 0.0
    spot = np.column_stack([sample.cells[sample.track, 0], np.floor(sample.place[:, :2] / CELL_M)])
    _, key = np.unique(np.nan_to_num(spot, nan=-1.0), axis=0, return_inverse=True)
    return _scatter_m(sample, fitted, (sample.instance == STATIC) & ~sample.edge, key.ravel(), _NEAR_ON_MAP_M)


def _says_itself(frames: Sequence[TracedFrame]) -> bool:
    """Whether a twin tells how sure it is."""
    return any(np.any((frame.exact or frame).unsure_m > 0) for frame in frames)


def _scatter_m(sample: Sample, fitted: Fitted, of_kind: np.ndarray, key: np.ndarray, near_m: float) -> float:
    """Standard deviation [m] of surfaces across themselves, from groups of beams with the same error by `key` (n,)."""
    fit = fitted.fit
    residual = fit.range_z * fit.range_sigma_m
    used = np.flatnonzero(of_kind & sample.returned & sample.compared & (np.abs(residual) < near_m))
    across = sample.cos_incidence[used]
    group, count = np.unique(key[used], return_inverse=True, return_counts=True)[1:]
    mean = np.bincount(group, residual[used] * across) / count
    noise = np.bincount(group, (fitted.prediction.range_sigma_m[used] * across) ** 2) / count**2
    told = count >= _FEWEST_BEAMS
    if np.count_nonzero(told) < _FEWEST_GROUPS:
        return 0.0
    scatter = _OF_NORMAL * float(np.median(np.abs(mean[told])))
    excess = scatter**2 - float(np.median(noise[told]))
    return float(np.sqrt(excess)) if excess > _LEAST_M**2 else 0.0


def differs(scatter: Scatter, known: Scatter) -> bool:
    """Whether two scatters are worth a fit anew."""
    pairs = ((scatter.labels_m, known.labels_m), (scatter.map_m, known.map_m))
    return any(abs(one - other) > _WORTH * max(one, other) for one, other in pairs)


def with_scatter(frames: Sequence[TracedFrame], scatter: Scatter) -> list[TracedFrame]:
    """Frames whose twin is off by so much, or exact."""
    return [_unsure(frame.exact or frame, scatter) for frame in frames]


def _unsure(frame: TracedFrame, scatter: Scatter) -> TracedFrame:
    if scatter == Scatter():
        return frame
    solid, traced = frame.shot.hits.solid, frame.shot.traced
    assert traced is not None  # frames are traced
    steep = np.abs(np.einsum("ij,ij->i", solid.normal, traced.direction))
    along = np.where(solid.instance >= 0, scatter.labels_m / np.maximum(steep, _STEEPEST), 0.0)
    along += np.where(solid.instance == STATIC, scatter.map_m / np.maximum(steep, _STEEPEST_OF_MAP), 0.0)
    edge = frame.edge
    if scatter.labels_m > 0:
        edge = edge | _beside_objects(frame, _SIGMAS * scatter.labels_m)
    if scatter.map_m > 0:
        edge = edge | _met_aside(frame, _SIGMAS * scatter.map_m)
    unsure = np.hypot(frame.unsure_m, along).astype(np.float32)
    return replace(frame, unsure_m=unsure, edge=edge, scatter=scatter, exact=frame)


def _met_aside(frame: TracedFrame, reach_m: float) -> np.ndarray:
    """(n,) bool: beams that returned not from their surface, but from where another stands within a reach [m] aside."""
    traced, world, measured_m = frame.shot.traced, frame.shot.world, frame.observed.along_m
    assert traced is not None and world is not None  # frames are traced
    elsewhere = np.isfinite(measured_m) & ~(np.abs(measured_m - frame.shot.hits.solid.range_m) < _NEAR_M)
    rows = np.flatnonzero(elsewhere)
    origin, direction, measured_m = traced.origin[rows], traced.direction[rows], measured_m[rows]
    time_s = np.broadcast_to(traced.time_s, len(elsewhere))[rows]
    x, y, _ = direction.T
    left = np.stack([-y, x, np.zeros_like(x)], 1) / np.maximum(np.hypot(x, y), 1e-6)[:, None]
    up = np.cross(direction, left)
    met = np.zeros(len(rows), bool)
    for share in _REACHES:
        for turn in np.arange(_ASIDE) * (2 * np.pi / _ASIDE):
            shift = share * reach_m * (np.cos(turn) * left + np.sin(turn) * up)
            surface = world.shoot(origin + shift, direction, time_s, frame.shot.pattern.range_m[1])
            met |= np.abs(surface.range_m - measured_m) < _NEAR_M
    elsewhere[rows] = met
    return elsewhere


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

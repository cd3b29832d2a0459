"""Samples of a beam's footprint, and the echo they give together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sensors.beams import Beams
from sensors.hits import Hits
from sensors.normals import decode_normals
from sensors.returns import Returns

_AT = float(np.sqrt(2 / 3))
_ASIDE = ((_AT, 0.0), (0.0, -_AT), (-_AT, 0.0), (0.0, _AT))
_WEIGHTS = (1 / 4, 3 / 16, 3 / 16, 3 / 16, 3 / 16)
"""Middle and four samples (up, left) in radii: exact to third order on a uniform disc (Stroud 1971)."""
_SAME_FACE_COS = 0.9998
_SAME_FACE_SLANT = 0.2  # neighbouring samples of one face differ in range by less than this share


def samples_aside(beams: Beams, radius_rad: float) -> list[Beams]:
    """The four samples around the middle of each beam."""
    x, y, z = beams.direction.T
    flat = np.maximum(np.hypot(x, y), np.float32(1e-6))
    left = np.stack([-y / flat, x / flat, np.zeros_like(x)], 1)
    up = np.stack([-z * x / flat, -z * y / flat, flat], 1)
    shrink = np.float32(1 / np.sqrt(1 + (_AT * radius_rad) ** 2))
    steps = [np.float32(a * radius_rad) * up + np.float32(b * radius_rad) * left for a, b in _ASIDE]
    return [replace(beams, direction=(beams.direction + step) * shrink) for step in steps]


def strongest_echo(returns: Returns, samples: list[Hits], pulse_m: float) -> Returns:
    """One return a beam, of the strongest group of samples that merge.

    Samples merge when their ranges are closer than `pulse_m`, or when they lie on one flat face: between them the
    footprint fills the face, and the pulse is stretched, not split.

    Args:
        returns: of the middle samples.
        samples: what the five samples of every beam met, the middle first.
        pulse_m: c·τ/2.
    """
    ranges = [hits.solid.range_m for hits in samples]
    signal = [np.float32(w) * hits.reflectance(hits.solid) for w, hits in zip(_WEIGHTS, samples, strict=True)]
    nearest, farthest = ranges[0].copy(), ranges[0].copy()
    for other in ranges[1:]:
        np.minimum(nearest, other, out=nearest)
        np.maximum(farthest, other, out=farthest)
    whole = farthest < nearest + np.float32(pulse_m)
    one = returns.take(whole[returns.beam])
    total = np.zeros(len(one), np.float32)
    moment = np.zeros(len(one), np.float32)
    for r, s in zip(ranges, signal, strict=True):
        part = s.take(one.beam)
        total += part
        moment += part * (r.take(one.beam) - one.range_m)
    mean = one.range_m + moment / np.maximum(total, np.float32(1e-9))
    one = replace(one, range_m=mean, intensity=total)
    rest = np.flatnonzero(~whole & np.isfinite(nearest)).astype(np.int32)
    return one.merged(_strongest_group(rest, samples, ranges, signal, pulse_m)) if len(rest) else one


def _strongest_group(
    beam: np.ndarray, samples: list[Hits], all_ranges: list[np.ndarray], all_signal: list[np.ndarray], pulse_m: float
) -> Returns:
    """Returns of beams whose samples fall into several groups: only the strongest group counts."""
    ranges = np.stack([column[beam] for column in all_ranges])
    order = np.argsort(ranges, axis=0, kind="stable")
    column = np.arange(len(beam))

    def gathered(columns: list[np.ndarray]) -> np.ndarray:
        return np.stack([values[beam] for values in columns])[order, column]

    r, s = gathered(all_ranges), gathered(all_signal)
    normal = decode_normals(gathered([hits.solid.normal_code for hits in samples]).reshape(-1, 2)).reshape(*r.shape, 3)
    instance = gathered([hits.solid.instance for hits in samples])
    met = np.isfinite(r)
    gap = np.diff(np.where(met, r, 1e6), axis=0)
    parallel = np.einsum("ijk,ijk->ij", normal[1:], normal[:-1]) > _SAME_FACE_COS
    slanted = (instance[1:] == instance[:-1]) & parallel & (gap < _SAME_FACE_SLANT * np.where(met[:-1], r[:-1], 0))
    linked = ((gap < pulse_m) | slanted) & met[1:]
    group = np.concatenate([np.zeros((1, len(beam)), int), np.cumsum(~linked, axis=0)])
    strength = np.stack([np.where(group == number, s, 0).sum(0) for number in range(len(r))])
    chosen = (group == strength.argmax(0)) & met
    # A black surface has no signal to weigh with: its samples count alike.
    weight = np.where(chosen, np.maximum(s, np.float32(1e-9)), 0)
    mean = (weight * np.where(chosen, r, 0)).sum(0) / weight.sum(0)
    best = weight.argmax(0)
    sample = order[best, column]

    def picked(columns: list[np.ndarray]) -> np.ndarray:
        return np.stack([values[beam] for values in columns])[sample, column]

    return Returns(
        beam=beam,
        range_m=mean.astype(np.float32),
        intensity=strength.max(0).astype(np.float32),
        reflectance=picked([hits.reflectance(hits.solid) for hits in samples]),
        normal_code=picked([hits.solid.normal_code for hits in samples]),
        material=picked([hits.solid.material for hits in samples]),
        instance=picked([hits.solid.instance for hits in samples]),
        return_no=np.zeros(len(beam), np.uint8),
    )

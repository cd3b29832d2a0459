"""Samples of a beam's footprint, and their combined echo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sensors.hits import Hits
from sensors.normals import decode_normals
from sensors.returns import Returns

_AT = float(np.sqrt(2 / 3))
_ASIDE = ((_AT, 0.0), (0.0, -_AT), (-_AT, 0.0), (0.0, _AT))
_WEIGHTS = (1 / 4, 3 / 16, 3 / 16, 3 / 16, 3 / 16)
"""Middle and four samples (up, left) in radii: exact to third order on a uniform disc (Stroud 1971)."""
_SAME_FACE_COS = 0.9998
_SAME_FACE_SLANT = 0.2  # neighbouring samples of one face differ in range by less than this share


def directions_aside(middle: np.ndarray, radius_rad: float) -> np.ndarray:
    """Directions of the four samples around the middle (n, 3) of each beam, (n, 4, 3) float32."""
    x, y, z = middle.T
    flat = np.maximum(np.hypot(x, y), np.float32(1e-6))
    left = np.stack([-y / flat, x / flat, np.zeros_like(x)], 1)
    up = np.stack([-z * x / flat, -z * y / flat, flat], 1)
    shrink = np.float32(1 / np.sqrt(1 + (_AT * radius_rad) ** 2))
    steps = [np.float32(a * radius_rad) * up + np.float32(b * radius_rad) * left for a, b in _ASIDE]
    return np.stack([(middle + step) * shrink for step in steps], 1)


def strongest_echo(returns: Returns, middle: Hits, aside: Hits, pulse_m: float) -> Returns:
    """Return one return per beam, from the strongest group of samples that merge.

    Samples merge when their ranges are closer than `pulse_m`, or when they lie on one flat face: between them the
    footprint fills the face, and the pulse is stretched, not split.

    Args:
        returns: of the middle samples.
        middle: what the middle of every beam met.
        aside: hits of the four samples around it, row 4 · beam + sample.
        pulse_m: c·τ/2.
    """
    around = aside.solid.range_m.reshape(-1, len(_ASIDE))
    nearest, farthest = middle.solid.range_m.copy(), middle.solid.range_m.copy()
    for column in around.T:
        np.minimum(nearest, column, out=nearest)
        np.maximum(farthest, column, out=farthest)
    whole = farthest < nearest + np.float32(pulse_m)
    one = returns.take(whole[returns.beam])
    bare = aside.reflectance(aside.solid).reshape(-1, len(_ASIDE))
    signal, total = bare.take(one.beam, axis=0), np.float32(_WEIGHTS[0]) * one.reflectance
    offset, moment = around.take(one.beam, axis=0), np.zeros(len(one), np.float32)
    for column, weight in enumerate(_WEIGHTS[1:]):
        part = signal[:, column] * np.float32(weight)
        total += part
        moment += part * (offset[:, column] - one.range_m)
    mean = one.range_m + moment / np.maximum(total, np.float32(1e-9))
    one = replace(one, range_m=mean, intensity=total)
    rest = np.flatnonzero(~whole & np.isfinite(nearest)).astype(np.int32)
    return one.merged(_strongest_group(rest, middle, aside, pulse_m)) if len(rest) else one


def _strongest_group(beam: np.ndarray, middle: Hits, aside: Hits, pulse_m: float) -> Returns:
    """Returns of beams whose samples fall into several groups: only the strongest group counts."""
    rows = (len(_ASIDE) * beam[:, None] + np.arange(len(_ASIDE))).ravel()
    centre, round_it = middle.solid.take(beam), aside.solid.take(rows)

    def samples(of_middle: np.ndarray, of_aside: np.ndarray) -> np.ndarray:
        shape = of_middle.shape[1:]
        return np.concatenate([of_middle[None], of_aside.reshape(len(beam), -1, *shape).swapaxes(0, 1)])

    ranges = samples(centre.range_m, round_it.range_m)
    bare = samples(middle.reflectance(centre), aside.reflectance(round_it))
    order = np.argsort(ranges, axis=0, kind="stable")
    column = np.arange(len(beam))

    r, s = ranges[order, column], (bare * np.array(_WEIGHTS, np.float32)[:, None])[order, column]
    codes, instances = samples(centre.normal_code, round_it.normal_code), samples(centre.instance, round_it.instance)
    normal = decode_normals(codes[order, column].reshape(-1, 2)).reshape(*r.shape, 3)
    instance = instances[order, column]
    met = np.isfinite(r)
    gap = np.diff(np.where(met, r, 1e6), axis=0)
    parallel = np.einsum("ijk,ijk->ij", normal[1:], normal[:-1]) > _SAME_FACE_COS
    slanted = (instance[1:] == instance[:-1]) & parallel & (gap < _SAME_FACE_SLANT * np.where(met[:-1], r[:-1], 0))
    linked = ((gap < pulse_m) | slanted) & met[1:]
    group = np.concatenate([np.zeros((1, len(beam)), int), np.cumsum(~linked, axis=0)])
    strength = np.stack([np.where((group == number) & met, s, 0).sum(0) for number in range(len(r))])
    chosen = (group == strength.argmax(0)) & met
    # A black surface has no signal for weighting: its samples have equal weight.
    weight = np.where(chosen, np.maximum(s, np.float32(1e-9)), 0)
    mean = (weight * np.where(chosen, r, 0)).sum(0) / weight.sum(0)
    best = weight.argmax(0)
    sample = order[best, column]

    materials = samples(centre.material, round_it.material)
    return Returns(
        beam=beam,
        range_m=mean.astype(np.float32),
        intensity=strength.max(0).astype(np.float32),
        reflectance=bare[sample, column],
        normal_code=codes[sample, column],
        material=materials[sample, column],
        instance=instances[sample, column],
        return_no=np.zeros(len(beam), np.uint8),
    )

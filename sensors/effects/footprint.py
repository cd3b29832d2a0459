"""Samples of a beam's footprint, and the echo they give together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sensors.normals import decode_normals
from sensors.returns import Returns

_AT = float(np.sqrt(2 / 3))
FOOTPRINT = ((0.0, 0.0), (_AT, 0.0), (0.0, -_AT), (-_AT, 0.0), (0.0, _AT))
"""(up, left) of the five samples in radii: with `WEIGHTS` exact to third order on a uniform disc (Stroud 1971)."""
WEIGHTS = np.array([1 / 4, 3 / 16, 3 / 16, 3 / 16, 3 / 16], np.float32)
_SAME_FACE_COS = 0.9998


def strongest_echo(samples: list[Returns], beams: int, pulse_m: float) -> Returns:
    """One return a beam, of the strongest group of samples that merge.

    Samples merge when their ranges are closer than `pulse_m`, or when they lie on one flat face: between them the
    footprint fills the face, and the pulse is stretched, not split.
    """
    rows = np.full((len(samples), beams), -1)
    ranges = np.full((len(samples), beams), np.inf, np.float32)
    signal = np.zeros((len(samples), beams), np.float32)
    for number, sample in enumerate(samples):
        rows[number, sample.beam] = np.arange(len(sample))
        ranges[number, sample.beam] = sample.range_m
        signal[number, sample.beam] = WEIGHTS[number] * sample.intensity
    answering = np.flatnonzero((rows >= 0).any(0))
    spread = ranges[:, answering].max(0) - ranges[:, answering].min(0)
    whole = spread < pulse_m
    best = np.empty(len(answering), np.int64)
    total = np.empty(len(answering), np.float32)
    mean = np.empty(len(answering), np.float32)
    plain = answering[whole]
    best[whole], total[whole], mean[whole] = _group(signal[:, plain], ranges[:, plain])
    split = answering[~whole]
    best[~whole], total[~whole], mean[~whole] = _strongest_group(
        samples, rows[:, split], ranges[:, split], signal[:, split], pulse_m
    )

    order = np.concatenate([np.zeros(1, np.int64), np.cumsum([len(sample) for sample in samples])])
    merged = samples[0]
    for sample in samples[1:]:
        merged = _stacked(merged, sample)
    chosen = merged.take(order[best] + rows[best, answering])
    return replace(chosen, range_m=mean, intensity=total)


def _group(signal: np.ndarray, ranges: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Strongest sample, total signal and mean range of columns (k, n) whose samples all merge."""
    total = signal.sum(0)
    # A black surface has no signal to weigh with: its centre counts.
    weight = np.where(total > 0, signal, (np.isfinite(ranges)).astype(np.float32))
    finite = np.where(np.isfinite(ranges), ranges, 0)
    mean = (weight * finite).sum(0) / weight.sum(0)
    return weight.argmax(0), total, mean.astype(np.float32)


def _strongest_group(
    samples: list[Returns], rows: np.ndarray, ranges: np.ndarray, signal: np.ndarray, pulse_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of columns whose samples fall into several groups: only the strongest group counts."""
    order = np.argsort(ranges, axis=0, kind="stable")
    r, s = np.take_along_axis(ranges, order, 0), np.take_along_axis(signal, order, 0)
    sorted_rows = np.take_along_axis(rows, order, 0)
    normal = np.zeros((*r.shape, 3), np.float32)
    instance = np.full(r.shape, -9)
    for number, sample in enumerate(samples):
        here = (order == number) & (sorted_rows >= 0)
        normal[here] = decode_normals(sample.normal_code[sorted_rows[here]])
        instance[here] = sample.instance[sorted_rows[here]]
    with np.errstate(invalid="ignore"):
        close = np.diff(r, axis=0) < pulse_m
    flat = (instance[1:] == instance[:-1]) & (np.einsum("ijk,ijk->ij", normal[1:], normal[:-1]) > _SAME_FACE_COS)
    # On one face ranges differ by slant alone; parallel faces one behind the other meet the beam less obliquely.
    linked = (close | (flat & (np.diff(np.where(np.isfinite(r), r, 1e6), axis=0) < 0.2 * r[:-1]))) & np.isfinite(r[1:])
    group = np.concatenate([np.zeros((1, r.shape[1]), int), np.cumsum(~linked, axis=0)])
    strength = np.stack([np.where(group == g, s, 0).sum(0) for g in range(len(r))])
    chosen = group == strength.argmax(0)
    kept = np.where(chosen & np.isfinite(r), r, np.inf)
    at, total, mean = _group(np.where(chosen, s, 0), kept)
    return np.take_along_axis(order, at[None], 0)[0], total, mean


def _stacked(left: Returns, right: Returns) -> Returns:
    """Both tables one below the other, unsorted."""
    return Returns(*(np.concatenate([a, b]) for a, b in zip(vars(left).values(), vars(right).values(), strict=True)))

"""Footprints of some beams of a revolution: only beams next to another surface are traced again.

Those of the others lie on the face that the beam meets, whose plane says how far.
"""

from __future__ import annotations

import numpy as np

from sensors.effects.surfaces.footprint import directions_aside
from sensors.effects.surfaces.footprint_cache import SAMPLES, TURNED, FootprintCache
from sensors.hits import Hits, Surface
from sensors.shot import Shot

_AROUND = 2  # firings to each side
_PROBED_RAD = (1e-3, 2e-3, 3e-3)


def footprints_of_some(shot: Shot, radius_rad: float) -> Hits:
    """Surfaces hit by samples around the centre of each beam of a shot, in row 4 · beam + sample.

    Args:
        shot: of some beams of a whole revolution.
        radius_rad: of the footprint, within two firings or one ring.
    """
    hits, traced = shot.hits, shot.traced
    if traced is None or shot.world is None:
        raise ValueError("the footprint is new rays; measure with trace_and_measure")
    requested = shot.lasting("footprints", lambda: _Request(shot))
    beam, known = requested.beam, requested.known
    every = directions_aside(traced.direction, radius_rad)
    time_s = np.broadcast_to(traced.time_s, len(shot.rays))[beam]
    met = known.bent(radius_rad, traced.origin[beam], traced.direction[beam], time_s)
    around = hits.solid.take(np.repeat(np.arange(len(shot.rays)), SAMPLES))
    rows = (SAMPLES * beam[:, None] + np.arange(SAMPLES)).ravel()
    columns = {"range_m": _on_plane(hits.solid, traced.direction, every)}
    columns["range_m"][rows] = met.range_m
    for name in ("normal_code", "material", "instance"):
        columns[name] = np.array(getattr(around, name))
        columns[name][rows] = getattr(met, name)
    if around.measured is not None:  # of the surface that the centre of the beam meets
        same = (columns["material"] == around.material) & (columns["instance"] == around.instance)
        columns["measured"] = np.where(same, around.measured, np.float32(np.nan))
    return Hits(
        hits.rays, hits.pose, Surface(**columns), hits.pane_beam[:0], hits.pane.take(rows[:0]), hits.paint, hits.table
    )


def ranges_between(shot: Shot, radius_rad: float) -> np.ndarray:
    """Ranges (n, k) float64 of parts of footprints between the middle and the samples at a radius; infinite for none.

    A thin object, such as a post, may be between samples.
    """
    requested = shot.lasting("footprints", lambda: _Request(shot))
    inside = np.flatnonzero(np.array(_PROBED_RAD) < radius_rad)
    found = np.full((len(shot.rays), SAMPLES * len(inside)), np.inf)
    found[requested.beam] = requested.probed[:, : SAMPLES * len(inside)]
    return found


class _Request:
    """Beams whose footprints are requested, their hits, and hits in the footprints at the sampled radii.

    Attributes:
        beam: (k,) rows.
        known: what their footprints meet.
        probed: (k, samples · radii) ranges.
    """

    def __init__(self, shot: Shot) -> None:
        every = np.arange(len(shot.rays))
        footprints, solid = FootprintCache(shot, every), shot.hits.solid
        met = [footprints.met(radius_rad) for radius_rad in _PROBED_RAD]
        changes = _changes(shot)
        for around in met:
            # Something thin, such as a post, that no other beam meets.
            changes |= (around.instance.reshape(-1, SAMPLES) != solid.instance[:, None]).any(1)
            changes |= (around.material.reshape(-1, SAMPLES) != solid.material[:, None]).any(1)
        self.beam = np.flatnonzero(changes)
        self.known = FootprintCache(shot, self.beam)
        self.probed = np.hstack([one.range_m.reshape(-1, SAMPLES)[self.beam] for one in met]).astype(np.float64)


def _on_plane(solid: Surface, middle: np.ndarray, aside: np.ndarray) -> np.ndarray:
    """Ranges (4·n,) float32 of samples `aside` (n, 4, 3) on the planes that `middle` (n, 3) hits."""
    normal = solid.normal
    with np.errstate(divide="ignore", invalid="ignore"):
        farther = np.einsum("ij,ij->i", normal, middle)[:, None] / np.einsum("ij,ikj->ik", normal, aside)
        reach = solid.range_m[:, None] * farther
    return np.where((farther > 0) & np.isfinite(reach), reach, np.inf).astype(np.float32).ravel()


def _changes(shot: Shot) -> np.ndarray:
    """(n,) bool: beams of which a neighbour in the same or an adjacent ring hits another face or material."""
    assert shot.whole is not None and shot.rows is not None  # some of a revolution
    solid, firings = shot.whole.hits.solid, shot.pattern.firings
    last, found = len(solid.range_m) - 1, np.zeros(len(shot.rows), bool)
    for step in (*range(-_AROUND, 0), *range(1, _AROUND + 1), -firings, firings):
        other = np.clip(shot.rows + step, 0, last)
        turned = solid.normal_code[shot.rows].astype(int) - solid.normal_code[other]
        found |= (np.abs(turned) > TURNED).any(1)
        found |= solid.material[shot.rows] != solid.material[other]
        found |= solid.instance[shot.rows] != solid.instance[other]
    return found

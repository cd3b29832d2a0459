"""Silhouettes are no surer than poses and objects: what beams near them may meet instead, and how likely that is.

What stands beyond an edge is what the beams there met: no ray is traced for it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.sampling.gathering import Taken, gathered
from cosim.discrepancy.sampling.sample import Sample


def with_silhouettes(frames: Sequence[TracedFrame], sample: Sample, shift_m: float, turn_rad: float) -> Sample:
    """A sample in which beams near edges have a row for each side, see `Sample.own`.

    Beams that errors so large may have moved onto another material, or onto something thin that no beam meets, take no
    part; nor does any beam near an edge where the silhouettes of twins are not surveyed.

    Args:
        frames: traced.
        sample: as it was drawn from them.
        shift_m, turn_rad: how far edges may stand off, see `spreads`; 0 where they are as sharp as they were traced.
    """
    wide = shift_m > 0 or turn_rad > 0
    if not all(one.is_surveyed for one in frames):
        return sample.clear_of([one.unsure(shift_m, turn_rad) for one in frames] if wide else [])
    rng = np.random.default_rng(0)
    return gathered(frames, [_sides(one, sample, row, shift_m, turn_rad, rng) for row, one in enumerate(frames)])


def _sides(
    frame: TracedFrame, sample: Sample, number: int, shift_m: float, turn_rad: float, rng: np.random.Generator
) -> Taken:
    """A frame's rows, those that are about other sides at the end."""
    mine, share = np.flatnonzero(sample.frame == number), sample.settings.sampling.edge_share
    beam, weight, compared = sample.beam[mine], sample.weight[mine], sample.compared[mine]
    edge = frame.edge[beam] & compared
    side, chance = np.full((len(mine), 2), -1), np.zeros((len(mine), 2))
    kept, thinned = np.ones(len(mine), bool), np.zeros(len(mine), bool)
    if shift_m > 0 or turn_rad > 0:
        near = frame.near_edges(shift_m, turn_rad)[beam] & compared
        thinned, edge = near & ~edge, near  # the others were when they were drawn
        asked = np.zeros(len(frame.edge), bool)
        asked[beam] = ~near
        off = frame.beside_edges(shift_m, turn_rad, asked)[beam]
        kept = np.where(thinned, rng.random(len(mine)) < share, ~off)
        rows, sigmas = np.flatnonzero(near & kept), sample.settings.unsure.edge_sigmas
        spread, hits = (shift_m / sigmas, turn_rad / sigmas), frame.shot.hits
        side[rows], chance[rows] = frame.neighbours.other_sides(hits, beam[rows], *spread)
    chance = np.where(chance > sample.settings.unsure.least_chance, chance, 0.0)
    paired = kept & ~edge & (sample.partner[mine] >= 0)
    partner = np.where(paired, sample.partner[mine] - mine[:1].sum(), -1)
    partner = np.where(paired[partner] & (partner >= 0), (np.cumsum(kept) - 1)[partner], -1)
    own, kind = np.nonzero(chance)
    rows = np.flatnonzero(kept)
    return {
        "beam": np.append(beam[rows], beam[own]),
        "weight": np.where(thinned, weight / share, weight)[np.append(rows, own)],
        "partner": np.append(partner[rows], np.full(len(own), -1)),
        "own": np.append(np.arange(len(rows)), np.searchsorted(rows, own)),
        "met": np.append(beam[rows], side[own, kind]),
        "chance": np.append(1 - chance.sum(1)[rows], chance[own, kind]),
        "edge": edge[np.append(rows, own)],
    }

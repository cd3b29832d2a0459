"""Which beams of a drive are taken for a sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.sampling.gathering import Taken, gathered
from cosim.discrepancy.sampling.sample import Sample


def draw_sample(
    frames: Sequence[TracedFrame], count: int, rng: np.random.Generator, *, judging: bool | None = None
) -> Sample:
    """A sample of about `count` beams in neighbouring pairs: of every frame alike, more of objects than of the rest.

    Materials that few beams meet, as those of plates and signs, are taken nearly whole.

    Args:
        frames: in order of time.
        count: how many beams to take, roughly.
        rng: for the draw.
        judging: of a map made of the scans, take surfaces of those places that judge, or of the others; all by default.
    """
    if frames and frames[0].map is not None:
        return gathered(frames, _of_maps(frames, count, rng, judging))
    share = max(count // max(len(frames), 1), 1)
    return gathered(frames, [_choose(frame, share, rng) for frame in frames])


def whole_sample(frame: TracedFrame) -> Sample:
    """All beams of one frame."""
    count = len(frame.observed.rays)
    return gathered([frame], [_taken(np.arange(count), np.ones(count), np.full(count, -1))])


def _choose(frame: TracedFrame, share: int, rng: np.random.Generator) -> Taken:
    """Beams of a frame."""
    solid, rings, settings = frame.shot.hits.solid, frame.shot.rays.ring, frame.settings.sampling
    clear = frame.observed.trusted & ~frame.edge
    usable = frame.observed.trusted & ~frame.grazed if frame.is_surveyed else clear
    residual = np.abs(frame.observed.range_from(frame.shot.rays.origin) - solid.range_m)
    odd = frame.observed.returned & ~(residual < frame.settings.beams.same_m)
    odd &= clear
    chance = np.where(solid.instance >= 0, 3.0, np.where(solid.exists, 1.0, 0.15)) * usable
    chance = np.where(clear, chance, settings.edge_share * chance)
    chance = np.clip(chance * (share / 2 / max(chance.sum(), 1.0)), 0, 1)
    chance = np.where(odd, np.maximum(chance, min(1.0, settings.odd_share * share / max(odd.sum(), 1))), chance)
    chance = np.maximum(chance, _rare(solid.material, clear & solid.exists, settings.rare_share * share))
    first = rng.random(len(chance)) < chance
    taken = (first | np.append(False, first[:-1])) & usable
    before = np.append(0.0, chance[:-1])
    beams = np.flatnonzero(taken)
    lone = _lone(frame, share, rng)
    weight = 1 / (1 - (1 - chance[beams]) * (1 - before[beams]))
    follows = np.append(np.diff(beams) == 1, False)
    after = np.minimum(beams + 1, len(rings) - 1)
    follows &= (rings[beams] == rings[after]) & (solid.instance[beams] == solid.instance[after])
    follows &= solid.exists[beams] & solid.exists[after]
    partner = np.where(
        follows, np.arange(len(beams)) + 1, np.where(np.append(False, follows[:-1]), np.arange(len(beams)) - 1, -1)
    )
    if not len(lone):
        return _taken(beams, weight, partner)
    weight = np.append(weight, np.full(len(lone), weight.mean() if len(beams) else 1.0))
    order = np.argsort(np.append(beams, lone))
    place = np.argsort(order)
    partner = np.append(np.where(partner >= 0, place[partner], -1), np.full(len(lone), -1))
    return _taken(np.append(beams, lone)[order], weight[order], partner[order])


def _taken(beam: np.ndarray, weight: np.ndarray, partner: np.ndarray) -> Taken:
    return {"beam": beam, "weight": weight, "partner": partner}


def _of_maps(frames: Sequence[TracedFrame], count: int, rng: np.random.Generator, judging: bool | None) -> list[Taken]:
    """As `_choose`, for each frame; of each map as many beams as frames lie in it."""
    by_place: dict[str, list[int]] = {}
    for number, one in enumerate(frames):
        by_place.setdefault(one.place, []).append(number)
    found = {}
    for numbers in by_place.values():
        mine = [frames[number] for number in numbers]
        found |= dict(zip(numbers, _of_map(mine, count * len(mine) // len(frames), rng, judging), strict=True))
    return [found[number] for number in range(len(frames))]


def _of_map(frames: Sequence[TracedFrame], count: int, rng: np.random.Generator, judging: bool | None) -> list[Taken]:
    """As `_choose`, for each frame: several looks at each of some surfaces, rather at those seen from near and far."""
    surfaces = frames[0].map
    assert surfaces is not None  # asked before
    usable = [np.flatnonzero(one.observed.trusted & ~one.edge) for one in frames]
    met = np.concatenate([one.surface[rows] for one, rows in zip(frames, usable, strict=True)])
    most, looks = frames[0].settings.sampling.looks, np.bincount(met, minlength=len(surfaces))
    if judging is not None:
        looks = np.where(surfaces.judge == judging, looks, 0)
    taken = surfaces.sample(np.minimum(looks, most), count, rng)
    chance = np.zeros(len(surfaces))
    chance[taken] = np.minimum(most / looks[taken] / 2, 1.0)
    found = []
    for one, rows in zip(frames, usable, strict=True):
        first = rows[rng.random(len(rows)) < chance[one.surface[rows]]]
        beside = np.minimum(first + 1, len(one.surface) - 1)
        pairs = one.surface[beside] == one.surface[first]
        beams = np.intersect1d(np.append(first, beside[pairs]), rows)
        found.append(_taken(beams, np.ones(len(beams)), _partners(beams, one)))
    return found


def _partners(beams: np.ndarray, frame: TracedFrame) -> np.ndarray:
    """Row (n,) of the beam fired just before or after each at the same surface of a map; −1 where it is not taken."""
    follows = (np.diff(beams) == 1) & (np.diff(frame.surface[beams]) == 0)
    follows &= np.diff(frame.shot.rays.ring[beams].astype(int)) == 0
    rows = np.arange(len(beams))
    after, before = np.append(follows, False)[: len(beams)], np.append(False, follows)[: len(beams)]
    return np.where(after, rows + 1, np.where(before, rows - 1, -1))


def _rare(material: np.ndarray, usable: np.ndarray, wanted: float) -> np.ndarray:
    """Chances (n,) by which as many usable beams of every material are taken, `wanted` in all."""
    count = np.bincount(material[usable], minlength=int(material.max(initial=0)) + 1)
    each = wanted / max(np.count_nonzero(count), 1)
    return np.where(usable, np.minimum(each / np.maximum(count, 1), 1.0)[material], 0.0)


def _lone(frame: TracedFrame, share: int, rng: np.random.Generator) -> np.ndarray:
    """Some returns that the twin knows nothing of, where points tell which way their beams look: as many a ring."""
    observed, rings = frame.observed, frame.shot.rays.ring
    if not observed.recovered:
        return np.zeros(0, int)
    beams = np.flatnonzero(observed.returned & ~observed.trusted)
    count = np.bincount(rings[beams], minlength=256)
    wanted = frame.settings.sampling.lone_share * share / max(np.count_nonzero(count), 1)
    return beams[rng.random(len(beams)) < wanted / count[rings[beams]]]


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

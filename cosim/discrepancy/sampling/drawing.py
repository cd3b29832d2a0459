"""Sampling of a drive's beams, with their sampling probabilities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.sampling.gathering import Taken, gather_sample
from cosim.discrepancy.sampling.sample import Sample


def draw_sample(frames: Sequence[TracedFrame], count: int, rng: np.random.Generator) -> Sample:
    """Draw a sample of about `count` beams in neighbouring pairs, equally many per frame.

    Objects are sampled more densely than the static world; beams on rare materials, for example number plates and
    signs, are nearly all included. Some firings are sampled as a whole, because errors that the beams of a firing have
    in common show only in pairs of beams of one firing.

    Args:
        frames: traced frames, in order of time.
        count: approximate number of beams.
        rng: random generator.
    """
    if frames and frames[0].map is not None:
        return gather_sample(frames, _sample_maps(frames, count, rng))
    share = max(count // max(len(frames), 1), 1)
    return gather_sample(frames, [_sample_frame(frame, share, rng) for frame in frames])


def whole_sample(frame: TracedFrame) -> Sample:
    """Return a sample with all beams of one frame."""
    count = len(frame.observed.rays)
    return gather_sample([frame], [_rows(np.arange(count), np.ones(count), np.full(count, -1))])


def _sample_frame(frame: TracedFrame, share: int, rng: np.random.Generator) -> Taken:
    """Sample beams of a frame."""
    solid, rings, settings = frame.shot.hits.solid, frame.shot.rays.ring, frame.settings.sampling
    clear = frame.observed.trusted & ~frame.edge
    usable = frame.observed.trusted & ~frame.grazed if frame.is_surveyed else clear
    residual = np.abs(frame.observed.range_from(frame.shot.rays.origin) - solid.range_m)
    is_outlier = frame.observed.returned & ~(residual < frame.settings.beams.same_m)
    is_outlier &= clear
    chance = np.where(solid.instance >= 0, 3.0, np.where(solid.exists, 1.0, 0.15)) * usable
    chance = np.where(clear, chance, settings.edge_share * chance)
    paired_share = (1 - settings.firing_share) * share
    chance = np.clip(chance * (paired_share / 2 / max(chance.sum(), 1.0)), 0, 1)
    chance = np.where(
        is_outlier, np.maximum(chance, min(1.0, settings.odd_share * share / max(is_outlier.sum(), 1))), chance
    )
    chance = np.maximum(chance, _rare_probabilities(solid.material, clear & solid.exists, settings.rare_share * share))
    first = rng.random(len(chance)) < chance
    chance_of_firing = min(settings.firing_share * share / max(clear.sum(), 1), 1.0)
    pattern = frame.shot.pattern
    is_whole = clear & np.tile(rng.random(pattern.firings) < chance_of_firing, pattern.rings)
    is_taken = ((first | np.append(False, first[:-1])) & usable) | is_whole
    before = np.append(0.0, chance[:-1])
    beams = np.flatnonzero(is_taken)
    unmatched = _sample_unmatched(frame, share, rng)
    weight = 1 / (1 - (1 - chance[beams]) * (1 - before[beams]) * (1 - chance_of_firing * clear[beams]))
    follows = np.zeros(len(beams), bool)
    follows[:-1] = np.diff(beams) == 1
    after = np.minimum(beams + 1, len(rings) - 1)
    follows &= (rings[beams] == rings[after]) & (solid.instance[beams] == solid.instance[after])
    follows &= solid.exists[beams] & solid.exists[after]
    partner = np.where(
        follows, np.arange(len(beams)) + 1, np.where(np.roll(follows, 1), np.arange(len(beams)) - 1, -1)
    )  # the last beam never has a successor
    if not len(unmatched):
        return _rows(beams, weight, partner)
    weight = np.append(weight, np.full(len(unmatched), weight.mean() if len(beams) else 1.0))
    order = np.argsort(np.append(beams, unmatched))
    position = np.argsort(order)
    partner = np.append(np.where(partner >= 0, position[partner], -1), np.full(len(unmatched), -1))
    return _rows(np.append(beams, unmatched)[order], weight[order], partner[order])


def _rows(beam: np.ndarray, weight: np.ndarray, partner: np.ndarray) -> Taken:
    return {"beam": beam, "weight": weight, "partner": partner}


def _sample_maps(frames: Sequence[TracedFrame], count: int, rng: np.random.Generator) -> list[Taken]:
    """Sample beams of each frame on maps made from the scans; the number per map is proportional to its frames."""
    by_place: dict[str, list[int]] = {}
    for number, frame in enumerate(frames):
        by_place.setdefault(frame.place, []).append(number)
    chosen = {}
    for numbers in by_place.values():
        frames_of_map = [frames[number] for number in numbers]
        chosen |= dict(
            zip(
                numbers,
                _sample_map(frames_of_map, count * len(frames_of_map) // len(frames), rng),
                strict=True,
            )
        )
    return [chosen[number] for number in range(len(frames))]


def _sample_map(frames: Sequence[TracedFrame], count: int, rng: np.random.Generator) -> list[Taken]:
    """Sample beams of each frame in one map: several per surface, preferring surfaces seen from near and far."""
    surfaces = frames[0].map
    assert surfaces is not None  # the caller checked it
    usable = [np.flatnonzero(frame.observed.trusted & ~frame.edge) for frame in frames]
    surface = np.concatenate([frame.surface[rows] for frame, rows in zip(frames, usable, strict=True)])
    most, observations = frames[0].settings.sampling.beams_per_surface, np.bincount(surface, minlength=len(surfaces))
    sampled = surfaces.sample(np.minimum(observations, most), count, rng)
    chance = np.zeros(len(surfaces))
    chance[sampled] = np.minimum(most / observations[sampled] / 2, 1.0)
    chosen = []
    for frame, rows in zip(frames, usable, strict=True):
        first = rows[rng.random(len(rows)) < chance[frame.surface[rows]]]
        neighbour = np.minimum(first + 1, len(frame.surface) - 1)
        pairs = frame.surface[neighbour] == frame.surface[first]
        beams = np.intersect1d(np.append(first, neighbour[pairs]), rows)
        chosen.append(_rows(beams, np.ones(len(beams)), _partners(beams, frame)))
    return chosen


def _partners(beams: np.ndarray, frame: TracedFrame) -> np.ndarray:
    """Row (n,) of the sampled beam fired directly before or after that hits the same map surface; −1 for none."""
    follows = (np.diff(beams) == 1) & (np.diff(frame.surface[beams]) == 0)
    follows &= np.diff(frame.shot.rays.ring[beams].astype(int)) == 0
    rows = np.arange(len(beams))
    after, before = np.append(follows, False)[: len(beams)], np.append(False, follows)[: len(beams)]
    return np.where(after, rows + 1, np.where(before, rows - 1, -1))


def _rare_probabilities(material: np.ndarray, usable: np.ndarray, wanted: float) -> np.ndarray:
    """Sampling probabilities (n,) for equally many usable beams per material, `wanted` in total."""
    count = np.bincount(material[usable], minlength=int(material.max(initial=0)) + 1)
    each = wanted / max(np.count_nonzero(count), 1)
    return np.where(usable, np.minimum(each / np.maximum(count, 1), 1.0)[material], 0.0)


def _sample_unmatched(frame: TracedFrame, share: int, rng: np.random.Generator) -> np.ndarray:
    """Sample returns that cannot be compared with the twin but show the lasers' directions; equally many per ring."""
    observed, rings = frame.observed, frame.shot.rays.ring
    if not observed.recovered:
        return np.zeros(0, int)
    beams = np.flatnonzero(observed.returned & ~observed.trusted)
    count = np.bincount(rings[beams], minlength=256)
    wanted = frame.settings.sampling.lone_share * share / max(np.count_nonzero(count), 1)
    return beams[rng.random(len(beams)) < wanted / count[rings[beams]]]


def split_at_edges(frames: Sequence[TracedFrame], sample: Sample, shift_m: float, turn_rad: float) -> Sample:
    """Return a sample in which beams near edges have one row per side, see `Sample.own`.

    Beams are excluded if errors of this size may move them onto another material or a thin object between beams, and,
    for twins without surveyed silhouettes, if they are near an edge.

    Args:
        frames: traced frames.
        sample: sample drawn from them.
        shift_m, turn_rad: tolerance of edge positions [m, rad]; 0 for edges as traced.
    """
    wide = shift_m > 0 or turn_rad > 0
    if not all(frame.is_surveyed for frame in frames):
        return sample.clear_of([frame.near_uncertain_edges(shift_m, turn_rad) for frame in frames] if wide else [])
    rng = np.random.default_rng(0)
    return gather_sample(
        frames, [_rows_with_sides(frame, sample, row, shift_m, turn_rad, rng) for row, frame in enumerate(frames)]
    )


def _rows_with_sides(
    frame: TracedFrame, sample: Sample, number: int, shift_m: float, turn_rad: float, rng: np.random.Generator
) -> Taken:
    """Rows of a frame; the additional rows for other sides are at the end."""
    rows_of_frame, edge_share = np.flatnonzero(sample.frame == number), sample.settings.sampling.edge_share
    beam, weight, compared = sample.beam[rows_of_frame], sample.weight[rows_of_frame], sample.compared[rows_of_frame]
    edge = frame.edge[beam] & compared
    side, chance = np.full((len(rows_of_frame), 2), -1), np.zeros((len(rows_of_frame), 2))
    is_kept, is_thinned = np.ones(len(rows_of_frame), bool), np.zeros(len(rows_of_frame), bool)
    if shift_m > 0 or turn_rad > 0:
        near = frame.near_edges(shift_m, turn_rad)[beam] & compared
        is_thinned, edge = near & ~edge, near  # beams at traced edges were already thinned when drawn
        to_test = np.zeros(len(frame.edge), bool)
        to_test[beam] = ~near
        is_ambiguous = frame.near_other_materials(shift_m, turn_rad, to_test)[beam]
        is_kept = np.where(is_thinned, rng.random(len(rows_of_frame)) < edge_share, ~is_ambiguous)
        rows, sigmas = np.flatnonzero(near & is_kept), sample.settings.random_effects.edge_sigmas
        spread, hits = (shift_m / sigmas, turn_rad / sigmas), frame.shot.hits
        side[rows], chance[rows] = frame.neighbours.other_sides(hits, beam[rows], *spread)
    chance = np.where(chance > sample.settings.random_effects.least_chance, chance, 0.0)
    paired = is_kept & ~edge & (sample.partner[rows_of_frame] >= 0)
    partner = np.where(paired, sample.partner[rows_of_frame] - rows_of_frame[:1].sum(), -1)
    partner = np.where(paired[partner] & (partner >= 0), (np.cumsum(is_kept) - 1)[partner], -1)
    own, kind = np.nonzero(chance)
    rows = np.flatnonzero(is_kept)
    return {
        "beam": np.append(beam[rows], beam[own]),
        "weight": np.where(is_thinned, weight / edge_share, weight)[np.append(rows, own)],
        "partner": np.append(partner[rows], np.full(len(own), -1)),
        "own": np.append(np.arange(len(rows)), np.searchsorted(rows, own)),
        "met": np.append(beam[rows], side[own, kind]),
        "chance": np.append(1 - chance.sum(1)[rows], chance[own, kind]),
        "edge": edge[np.append(rows, own)],
    }

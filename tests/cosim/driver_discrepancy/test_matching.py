"""Lanes are found without the column, and light's offsets from when vehicles enter."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cosim.driver_discrepancy.matching import match_lanes
from cosim.driver_discrepancy.network import Network, read_network
from cosim.driver_discrepancy.placed import place
from cosim.driver_discrepancy.signals import estimate_phases, is_red
from cosim.driver_discrepancy.tracks import Tracks, gathered
from sumo_nets import read_town


@cache
def network() -> Network:
    town = read_town("town01")
    return read_network(town.net, town.additional)


def along(lanes: list[str], begin_s: float, speed_mps: float = 8.0) -> list[tuple[float, float, float, str]]:
    """Time, place and lane every 0.2 s along a chain of lanes."""
    shapes = [network().lanes[name].shape for name in lanes]
    lengths = [float(np.hypot(*np.diff(shape, axis=0).T).sum()) for shape in shapes]
    ends = np.cumsum(lengths)
    rows = []
    for number in range(int(ends[-1] / speed_mps / 0.2)):
        at = number * 0.2 * speed_mps
        k = min(int(np.searchsorted(ends, at, side="right")), len(shapes) - 1)
        shape, here = shapes[k], at - (ends[k] - lengths[k])
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(shape, axis=0).T))])
        x, y = (float(np.interp(here, way, shape[:, axis])) for axis in (0, 1))
        rows.append((begin_s + number * 0.2, x, y, lanes[k]))
    return rows


def chains(count: int) -> list[list[str]]:
    """Ways over two junctions, junctions' lanes included."""
    links, found = network().links, []
    for lane in sorted(links):
        chain = [lane]
        while len(chain) < 5 and links.get(chain[-1]):
            link = links[chain[-1]][len(found) % len(links[chain[-1]])]
            if link.via not in network().lanes:
                break
            chain += [link.via, link.target]
        if len(chain) == 5:
            found.append(chain)
    return found[:: max(1, len(found) // count)][:count]


def tracks_of(ways: list[list[str]], noise_m: float, begins_s: list[float] | None = None) -> Tracks:
    rng, ids, rows = np.random.default_rng(0), [], []
    for number, way in enumerate(ways):
        part = along(way, begins_s[number] if begins_s else 0.0)
        ids += [f"v{number}"] * len(part)
        rows += part
    xy = np.array([row[1:3] for row in rows]) + noise_m * rng.standard_normal((len(rows), 2))
    tracks = gathered(
        ids,
        ["car"] * len(ids),
        [row[3] for row in rows],
        np.array([row[0] for row in rows]),
        xy,
        np.full(len(rows), 8.0),
        np.zeros(len(rows)),
    )
    move = np.gradient(tracks.place, axis=0)
    return replace(tracks, heading_rad=np.arctan2(move[:, 1], move[:, 0]))


@pytest.mark.parametrize("noise_m", [0.0, 0.3])
def test_lanes_are_recovered(noise_m: float) -> None:
    known = tracks_of(chains(12), noise_m)
    smooth = tracks_of(chains(12), 0.0)
    bare = replace(known, lane=np.full(len(known), "", dtype="U64"), heading_rad=smooth.heading_rad)
    matched, notes = match_lanes(bare, network())
    edges = [[name.rpartition("_")[0] for name in one.lane] for one in (matched, known)]
    assert np.mean([a == b for a, b in zip(*edges, strict=True)]) > (0.96 if noise_m == 0 else 0.9)
    assert len(notes) == 1


def test_lanes_that_are_given_stay() -> None:
    known = tracks_of(chains(2), 0.0)
    assert match_lanes(known, network()) == (known, [])


def test_a_vehicle_that_never_moves_gets_the_heading_of_its_lane() -> None:
    known = tracks_of(chains(2), 0.0)
    rests = known.vehicle == 0
    row = int(np.flatnonzero(rests)[len(np.flatnonzero(rests)) // 2])
    place_of_rest = np.where(rests[:, None], known.place[row], known.place)
    unknown = replace(
        known,
        place=place_of_rest,
        heading_rad=np.where(rests, np.nan, known.heading_rad),
        lane=np.full(len(known), ""),
    )
    found, _ = match_lanes(unknown, network())
    assert set(found.lane[rests].tolist()) == {known.lane[row]}
    turned = np.angle(np.exp(1j * (found.heading_rad[rests] - known.heading_rad[row])))
    assert np.abs(turned).max() < 0.3


def test_the_offset_of_a_light_is_estimated() -> None:
    programs = network().programs
    ways = [
        (lane, link)
        for lane, links in sorted(network().links.items())
        for link in links
        if link.signal in programs and link.via in network().lanes and network().lanes[lane].length_m > 40
    ]
    chosen, begins, shift = [], [], 23.0
    for lane, link in ways[:30]:
        program, length = programs[link.signal], network().lanes[lane].length_m
        arrive = np.arange(20.0, 20.0 + program.cycle_s, 1.0)
        green = arrive[~is_red(program, link.index, arrive - shift)]
        for at in green[:: max(1, len(green) // 3)][:3].tolist():
            chosen.append([lane, link.via, link.target])
            begins.append(at - length / 8.0)
    if len(chosen) < 20:
        pytest.skip("the town has too few fixed-time lights")
    placed = place(tracks_of(chosen, 0.0, begins), network())
    phases = estimate_phases(placed)
    red = phases.red(placed)
    leaves = np.flatnonzero((np.diff(placed.code) != 0) & (np.diff(placed.tracks.vehicle) == 0))
    signalled = [row for row in leaves.tolist() if placed.lanes[placed.code[row + 1]][:1] == ":"]
    assert red[signalled].mean() < 0.05
    assert any("differs from the network's" in note for note in phases.notes)

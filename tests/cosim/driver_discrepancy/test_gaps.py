"""Accepted and rejected gaps at junctions without signals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.driver_discrepancy.channels import measure_channels
from cosim.driver_discrepancy.placed import place
from cosim.driver_discrepancy.tracks import Tracks, gathered
from tests.cosim.driver_discrepancy.test_matching import along, network

ENTERS_S, WAITS_FROM_S = 30.0, 18.0


def yielding_pair() -> tuple[list[str], list[str]]:
    """Ways (lane, lane inside the junction) of a minor and of a major stream that the minor one yields to."""
    links = network().links
    way = {link.via: [lane, link.via] for lane, found in links.items() for link in found if not link.signal}
    for minor, foes in sorted(network().yields_to.items()):
        for major in foes:
            if minor in way and major in way and way[minor][0] != way[major][0] and major not in network().yields_to:
                return way[minor], way[major]
    for minor, foes in sorted(network().yields_to.items()):
        for major in foes:
            yields = network().yields_to.get(major, ())
            if minor in way and major in way and way[minor][0] != way[major][0] and minor not in yields:
                return way[minor], way[major]
    raise AssertionError("the town has no junction with priority")


def entering(way: list[str], at_s: float, waits_s: float = 0.0) -> list[tuple[float, float, float, str]]:
    """Samples of a vehicle that enters the junction at a time, after it stood before it for a while."""
    rows = along(way, 0.0)
    enters = next(k for k, row in enumerate(rows) if row[3] == way[1])
    before = [(t - rows[enters][0] + at_s - waits_s, x, y, lane) for t, x, y, lane in rows[:enters]]
    _, x, y, lane = before[-1]
    rest = [(before[-1][0] + 0.2 * k, x, y, lane) for k in range(1, round(waits_s / 0.2) + 1)]
    return before + rest + [(t - rows[enters][0] + at_s, x, y, lane) for t, x, y, lane in rows[enters:]]


def crossing(majors_s: list[float]) -> Tracks:
    minor, major = yielding_pair()
    parts = {"minor": entering(minor, ENTERS_S, ENTERS_S - WAITS_FROM_S)}
    parts |= {f"major{k}": entering(major, at_s) for k, at_s in enumerate(majors_s)}
    ids = [name for name, rows in parts.items() for _ in rows]
    rows = [row for part in parts.values() for row in part]
    values = np.array([row[:3] for row in rows])
    lanes = [row[3] for row in rows]
    found = gathered(
        ids, ["car"] * len(ids), lanes, values[:, 0], values[:, 1:], np.full(len(ids), 5.0), np.zeros(len(ids))
    )
    move = np.diff(found.place, axis=0, append=found.place[-1:])
    return replace(found, speed_mps=np.hypot(*move.T) / 0.2)


def test_gaps_are_those_of_the_major_stream() -> None:
    placed = place(crossing([20.0, 22.4, 27.0, 34.0]), network())
    values = measure_channels(placed, np.zeros(len(placed.tracks), bool))
    minor = placed.tracks.ids.index("minor")
    accepted, rejected = (
        channel.values[placed.tracks.vehicle[channel.rows] == minor]
        for channel in (values["accepted_gap"], values["rejected_gap"])
    )
    assert accepted == pytest.approx([4.0], abs=0.21)
    assert rejected[1:] == pytest.approx([2.4, 4.6], abs=0.21)
    assert 2.0 - 0.3 <= rejected[0] <= 2.0 + 15 / 8 + 0.3  # from 15 m before the junction on


def test_a_gap_without_another_vehicle_counts_as_the_longest() -> None:
    placed = place(crossing([20.0]), network())
    values = measure_channels(placed, np.zeros(len(placed.tracks), bool))
    assert values["accepted_gap"].values.max() == 10.0

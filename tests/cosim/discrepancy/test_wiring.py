"""Swapped lasers are found before any fit; wrong elevations of all lasers are no swap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.discrepancy.analysis import context_of
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.data.wiring import exchanged_rings
from tests.cosim.discrepancy.small_drive import Yard


@pytest.fixture(scope="module")
def frames(biased_yard: Yard) -> list[TracedFrame]:
    context = context_of(opened(biased_yard.drive), biased_yard.sensor)
    return context.tracer.trace_all(context.split.fit[:2], ())


def _with_rings_of(frame: TracedFrame, order: list[int]) -> TracedFrame:
    """The frame with the measurements of its rings in another order."""
    pattern, observed = frame.shot.pattern, frame.observed
    shape = pattern.rings, pattern.firings
    moved = {
        name: getattr(observed, name).reshape(shape)[order].ravel() for name in ("along_m", "above_m", "intensity")
    }
    return replace(frame, observed=replace(observed, **moved))


def test_only_the_two_swapped_rings_are_detected(frames: list[TracedFrame]) -> None:
    rings = frames[0].shot.pattern.rings
    assert exchanged_rings(frames) == ()
    first, second = rings - 1, rings // 2
    order = list(range(rings))
    order[first], order[second] = second, first
    found = exchanged_rings([_with_rings_of(frame, order) for frame in frames])
    assert {(one.ring, one.agrees_with) for one in found} == {(first, second), (second, first)}
    assert all(one.own < 0.5 < one.other for one in found)


def test_rings_that_are_all_shifted_are_no_exchange(frames: list[TracedFrame]) -> None:
    rings = frames[0].shot.pattern.rings
    order = [*np.roll(np.arange(rings), 1).tolist()]
    assert exchanged_rings([_with_rings_of(frame, order) for frame in frames]) == ()

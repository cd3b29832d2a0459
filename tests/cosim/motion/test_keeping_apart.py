"""Whatever SUMO does with two vehicles, their bodies never overlap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.motion import Motion, overlaps
from tests.cosim.inspector import centres
from tests.cosim.road_users import road_users

STEP_S = 0.1
SIZES = [[4.5, 1.8, 1.5], [8.3, 2.5, 3.1]]


def meet(angle: float, speeds: tuple[float, float], late_s: float, allowed: bool = False) -> tuple[float, np.ndarray]:
    """Two vehicles that SUMO takes straight through each other: the deepest overlap, and how far each came."""
    motion, deepest = Motion(STEP_S), 0.0
    heading, time = np.array([0.0, angle]), np.arange(0, 12, STEP_S)
    forward = np.column_stack([np.cos(heading), np.sin(heading)])
    starts = -np.array([[40.0], [speeds[1] * (40.0 / speeds[0] + late_s)]]) * forward
    first = None
    for t in time:
        front = np.column_stack([starts + np.array(speeds)[:, None] * t * forward, np.zeros(2)])
        actors = road_users(["car", "truck"], front, sizes=SIZES, heading_rad=heading, speed_mps=1.0, ids=("a", "b"))
        actors = motion.update(replace(actors, speed_mps=np.array(speeds), time_s=float(t)))
        if first is None:
            first = actors.front[:, :2]
            motion.let_touch("a", "b") if allowed else motion.keep_apart("a", "b")
        found = overlaps(centres(actors), actors.heading_rad, actors.size)
        deepest = max(deepest, float(found.depth_m.max(initial=0.0)))
    return deepest, np.hypot(*(actors.front[:, :2] - first).T)


@given(st.floats(0.6, 2 * np.pi - 0.6), st.floats(2, 14), st.floats(2, 14), st.floats(-0.6, 0.6))
@settings(max_examples=40, deadline=None)
def test_vehicles_on_crossing_ways_stop_before_they_touch(angle, one, other, late_s):
    deepest, _ = meet(angle, (one, other), late_s)
    assert deepest == 0.0


def test_one_of_two_goes_on():
    _, way = meet(np.pi / 2, (8.0, 8.0), 0.3)
    assert way.max() > 60 and way.min() > 20


def test_who_may_touch_does():
    deepest, _ = meet(np.pi / 2, (8.0, 8.0), 0.0, allowed=True)
    assert deepest > 0.5

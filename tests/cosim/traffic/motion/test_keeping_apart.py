"""Whatever SUMO does with two vehicles, their bodies never overlap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.traffic.motion import Motion, overlaps
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.steps import Company, take_steps
from cosim.traffic.motion.stopping import travel
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
@settings(max_examples=25, deadline=None)
def test_vehicles_on_crossing_ways_stop_before_they_touch(angle, one, other, late_s):
    deepest, _ = meet(angle, (one, other), late_s)
    assert deepest == 0.0


def test_one_of_two_goes_on():
    _, way = meet(np.pi / 2, (8.0, 8.0), 0.3)
    assert way.max() > 60 and way.min() > 20


def test_who_may_touch_does():
    deepest, _ = meet(np.pi / 2, (8.0, 8.0), 0.0, allowed=True)
    assert deepest > 0.5


def crowd(seed: int, steps: int) -> float:
    """Drivers close together who steer, brake, stop dead and set off at random: the deepest overlap of their boxes."""
    rng, n = np.random.default_rng(seed), 16
    size = np.tile([4.0, 1.6, 1.5], (n, 1))
    chassis = Chassis.of(("car",) * n, size[:, 0])
    column, row = np.divmod(np.arange(n), 4)
    state = {"front": np.column_stack([column * 6.0, row * 2.2]), "heading": np.zeros(n)}
    state |= {"curvature": np.zeros(n), "speed": np.zeros(n)}
    deepest = 0.0
    for _ in range(steps):
        stops_dead = rng.random(n) < 0.02
        speed = np.where(stops_dead, 0.0, np.clip(state["speed"] + rng.uniform(-0.5, 0.7, n), 0, 9))
        turn = rng.uniform(-0.04, 0.04, n)
        curvature = np.clip(state["curvature"] + turn, -0.3, 0.3) * np.minimum(1, 5 / np.maximum(speed, 1) ** 2)
        front, heading = travel(state["front"], state["heading"], curvature, speed * STEP_S, chassis.rear_m)
        want = {"front": front, "heading": heading, "curvature": curvature, "speed": speed}
        state, _, _ = take_steps(Company(state, want, chassis, size, np.zeros(n), {}, frozenset()), STEP_S)
        forward = np.column_stack([np.cos(state["heading"]), np.sin(state["heading"])])
        found = overlaps(state["front"] - 2.0 * forward, state["heading"], size)
        deepest = max(deepest, float(found.depth_m.max(initial=0.0)))
    return deepest


@given(st.integers(0, 2**16))
@settings(max_examples=15, deadline=None)
def test_whatever_drivers_want_their_bodies_keep_apart(seed):
    assert crowd(seed, steps=150) == 0.0

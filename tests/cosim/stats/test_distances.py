"""A set is at no distance from itself; one moved by s is at distance s."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp, wasserstein_distance

from cosim.stats import Collected, Distance, compare_sets
from cosim.stats.distance import FrameSample, Pair
from tests.cosim.stats.sets import cloud_of_cars

FRAMES = 20
values = st.lists(st.floats(-100, 100, allow_subnormal=False), min_size=1, max_size=40)


def sample(numbers: list[float] | np.ndarray) -> FrameSample:
    numbers = np.asarray(numbers, float)
    return FrameSample.of(np.arange(len(numbers)) % 3, numbers, 3)


def once() -> np.ndarray:
    return np.ones((1, 3))


def some_cars(seed: int, moved: tuple[float, float, float] = (0, 0, 0), count: int = 200) -> Collected:
    rng = np.random.default_rng(seed)
    centre = rng.normal((30, 0, -1), (15, 8, 0.4), (count, 3)) + moved
    return cloud_of_cars(centre, rng.integers(0, FRAMES, count), FRAMES)


def by_key(a: Collected, b: Collected, draws: int = 20) -> dict[str, Distance]:
    return {item.key: item for item in compare_sets(a, b, np.random.default_rng(1), draws)}


@given(a=values, b=values)
def test_distances_agree_with_scipys(a: list[float], b: list[float]) -> None:
    pair = Pair(sample(a), sample(b))
    assert pair.wasserstein(once(), once())[0] == pytest.approx(wasserstein_distance(a, b), abs=1e-9)
    assert pair.kolmogorov(once(), once())[0] == pytest.approx(ks_2samp(a, b, method="asymp").statistic, abs=1e-12)


@given(a=values, shift=st.floats(-50, 50))
def test_a_shifted_sample_is_at_the_distance_of_its_shift(a: list[float], shift: float) -> None:
    pair = Pair(sample(a), sample(np.array(a) + shift))
    assert pair.wasserstein(once(), once())[0] == pytest.approx(abs(shift), abs=1e-9)


@given(a=values, turn=st.floats(-720, 720), origin=st.floats(0, 360))
def test_on_a_circle_the_origin_does_not_matter(a: list[float], turn: float, origin: float) -> None:
    angles = np.array(a)
    here = Pair(sample(angles), sample(angles + turn), 360.0).wasserstein(once(), once())[0]
    there = Pair(sample(angles + origin), sample(angles + turn + origin), 360.0).wasserstein(once(), once())[0]
    assert here == pytest.approx(there, abs=1e-6)
    assert here <= abs(turn) + 1e-6


def test_headings_across_the_seam_are_near() -> None:
    pair = Pair(sample([179.0] * 5), sample([-179.0] * 5), 360.0)
    assert pair.wasserstein(once(), once())[0] == pytest.approx(2.0)


@given(counts=st.lists(st.lists(st.integers(0, 5), min_size=4, max_size=4), min_size=3, max_size=3))
def test_a_histogram_equals_its_values(counts: list[list[int]]) -> None:
    table, centres = np.array(counts), np.array([0.5, 1.5, 2.5, 3.5])
    if not table.sum():
        return
    one_by_one = np.repeat(centres, table.sum(0))
    pair = Pair(FrameSample.of_histograms(table, centres), sample([1.0]))
    assert pair.wasserstein(once(), once())[0] == pytest.approx(wasserstein_distance(one_by_one, [1.0]))


def test_drawing_a_frame_twice_is_having_it_twice() -> None:
    a, b = sample([1.0, 5.0, 9.0]), sample([2.0, 2.0, 2.0])
    drawn = Pair(a, b).wasserstein(np.array([[2.0, 0, 1]]), once())[0]
    assert drawn == pytest.approx(wasserstein_distance([1, 1, 9], [2, 2, 2]))


def test_a_set_is_at_no_distance_from_itself() -> None:
    cars = some_cars(0)
    for distance in by_key(cars, cars).values():
        assert distance.wasserstein == pytest.approx(0, abs=1e-12)
        assert distance.low == 0
        assert distance.high == pytest.approx(0, abs=1e-12)


@settings(max_examples=10, deadline=None)
@given(forward=st.floats(-20, 20), left=st.floats(-20, 20))
def test_seen_from_above_a_shift_counts_by_its_mean_projection(forward: float, left: float) -> None:
    """The mean of |s · u| over directions u of the plane is 2/π |s|."""
    found = by_key(some_cars(0), some_cars(0, (forward, left, 0)))["birds_eye"]
    assert found.wasserstein == pytest.approx(2 / np.pi * np.hypot(forward, left), rel=0.01, abs=1e-9)


def test_raised_cars_are_farther_in_height_and_side_view_alone() -> None:
    found = by_key(some_cars(0), some_cars(0, (0, 0, 0.7)))
    assert found["centre_height"].wasserstein == pytest.approx(0.7)
    assert found["side_view"].wasserstein > 0.5
    assert found["birds_eye"].wasserstein == pytest.approx(0, abs=1e-12)


def test_a_real_difference_stands_out_from_chance_and_equal_sets_do_not() -> None:
    same = by_key(some_cars(0), some_cars(1), draws=100)["distance"]
    other = by_key(some_cars(0), some_cars(1, (12, 0, 0)), draws=100)["distance"]
    assert same.wasserstein < 3 * same.chance
    assert other.low > 2 * other.chance
    assert other.low < other.wasserstein < other.high


def test_distances_do_not_depend_on_which_set_is_first() -> None:
    a, b = some_cars(0), some_cars(1, (3, 2, 0.1), 120)
    there, back = by_key(a, b), by_key(b, a)
    for key in ("birds_eye", "distance", "centre_height", "heading", "cars_per_frame"):
        assert there[key].wasserstein == pytest.approx(back[key].wasserstein)


def test_the_same_generator_gives_the_same_interval() -> None:
    assert by_key(some_cars(0), some_cars(1)) == by_key(some_cars(0), some_cars(1))


def test_quantities_that_one_side_lacks_are_left_out() -> None:
    found = by_key(some_cars(0), cloud_of_cars(np.zeros((0, 3)), np.zeros(0, np.int64), FRAMES))
    assert set(found) == {"cars_per_frame"}


def test_the_floor_is_what_a_reference_is_from_itself() -> None:
    reference, same, moved = some_cars(1, count=2000), some_cars(2, count=2000), some_cars(3, (6, 0, 0), count=2000)
    near, far = by_key(same, reference)["distance"], by_key(moved, reference)["distance"]
    assert near.floor == pytest.approx(far.floor, rel=0.3)
    assert near.wasserstein < 2 * near.floor < far.wasserstein

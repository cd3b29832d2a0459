"""Footprints that meet things at several ranges may answer from any of them."""

import numpy as np
import pytest

from sensors.effects.split_echoes import CHANCE, elsewhere, is_split

_PULSE_M = 0.9


def test_a_footprint_is_split_where_a_gap_is_longer_than_a_pulse() -> None:
    slanted = np.array([20.0, 20.6, 20.0, 19.4, 20.0])
    at_an_edge = np.array([20.0, 20.0, 35.0, 20.0, 20.0])
    half_in_the_sky = np.array([20.0, 20.0, np.inf, 20.0, 20.0])
    assert is_split(np.stack([slanted, at_an_edge, half_in_the_sky]), _PULSE_M).tolist() == [False, True, False]


@pytest.mark.parametrize("ranges", [[20.0, 20.0, 35.0, 20.0, 20.0], [50.0, 47.0, 50.0, 54.0, np.inf]])
def test_other_parts_answer_with_the_stated_chance_in_all(ranges: list[float]) -> None:
    anywhere = np.arange(0.0, 120.0, 0.01)
    density = elsewhere(np.tile(ranges, (len(anywhere), 1)), anywhere, _PULSE_M)
    assert density.sum() * 0.01 == pytest.approx(CHANCE, rel=1e-3)


def test_whole_footprints_answer_from_nowhere_else() -> None:
    assert elsewhere(np.full((1, 5), 20.0), np.array([20.0]), _PULSE_M) == 0

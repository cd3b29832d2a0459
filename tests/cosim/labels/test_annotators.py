from itertools import pairwise

import numpy as np
import pytest

from cosim.labels.annotators import Annotators

IDS = [f"car{number}" for number in range(4000)]


def labelled_share(annotators: Annotators, height_px: float) -> float:
    return 1 - annotators.overlook(IDS, np.full(len(IDS), height_px), seed=3).mean()


@pytest.mark.parametrize(("height_px", "share"), [(13, 0.11), (15, 0.24), (21, 0.5), (35, 0.78), (46, 1.0)])
def test_the_share_labelled_is_what_kittis_annotators_labelled(height_px, share):
    assert labelled_share(Annotators(), height_px) == pytest.approx(share, abs=0.1)


def test_who_has_been_labelled_stays_labelled_while_coming_nearer():
    annotators = Annotators()
    labelled = [~annotators.overlook(IDS, np.full(len(IDS), px), seed=3) for px in (10, 20, 30, 50)]
    for before, after in pairwise(labelled):
        assert (after | ~before).all()
    assert labelled[-1].all()


def test_without_spread_the_limit_is_sharp_and_without_annotators_there_is_none():
    assert labelled_share(Annotators(spread=0), 20.9) == 0
    assert labelled_share(Annotators(spread=0), 21.1) == 1
    assert labelled_share(Annotators(enabled=False), 1.0) == 1


def test_the_seed_decides_who_is_overlooked():
    heights = np.full(len(IDS), 21.0)
    first, again, other = (Annotators().overlook(IDS, heights, seed) for seed in (1, 1, 2))
    assert (first == again).all() and 0.3 < (first == other).mean() < 0.7

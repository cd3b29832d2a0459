from collections import Counter

import numpy as np
import pytest

from assets.models.catalogue import CATALOGUE
from assets.paints import PAINTS, draw_paint


@pytest.mark.parametrize("kind", sorted({spec.kind for spec in CATALOGUE.values()}))
def test_every_kind_of_road_user_has_paints(kind):
    paint = draw_paint(kind, np.random.default_rng(0))
    assert 0.0 < paint.reflectance < 1.0
    assert all(0.0 <= channel <= 1.0 for channel in paint.rgb)


def test_the_same_seed_draws_the_same_paints():
    draws = [[draw_paint("car", rng).name for _ in range(20)] for rng in map(np.random.default_rng, (7, 7))]
    assert draws[0] == draws[1]


def test_paints_are_drawn_by_their_weights():
    rng = np.random.default_rng(1)
    count = Counter(draw_paint("car", rng).name for _ in range(4000))
    total = sum(weight for weight, _ in PAINTS["car"])
    for weight, paint in PAINTS["car"]:
        share = weight / total
        assert abs(count[paint.name] / 4000 - share) < 4 * np.sqrt(share * (1 - share) / 4000)


def test_black_cars_are_dark_and_white_cars_bright_in_the_near_infrared():
    paints = {paint.name: paint for _, paint in PAINTS["car"]}
    assert paints["black"].reflectance <= 0.1
    assert paints["white"].reflectance >= 0.55


def test_an_unknown_kind_is_refused_by_name():
    with pytest.raises(KeyError, match="ship"):
        draw_paint("ship", np.random.default_rng(0))

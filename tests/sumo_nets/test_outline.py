"""Outlines that cross themselves fall into polygons that do not."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from sumo_nets.reader import simple_outlines

BOW_TIE = [(0, 0), (10, 10), (10, 0), (0, 10)]
TWO_PARTS_AND_A_LINE = [
    (0, 0),
    (10, 0),
    (10, 10),
    (20, 10),
    (20, 20),
    (10, 20),
    (10, 10),
    (0, 10),
    (0, 5),
    (-5, 5),
    (0, 5),
]
ZIGZAG = [(0, 0), (30, 0), (30, 5), (20, -5), (10, 5), (0, -5)]


@pytest.mark.parametrize("corners", [BOW_TIE, TWO_PARTS_AND_A_LINE, ZIGZAG])
@pytest.mark.parametrize("offset", [0.0, 5e6])
def test_all_parts_of_an_outline_are_kept(corners, offset):
    points = np.column_stack([np.array(corners, float) + offset, np.arange(len(corners))])
    whole = shapely.make_valid(shapely.Polygon(points[:, :2]))
    parts = [shapely.Polygon(outline[:, :2]) for outline in simple_outlines(points)]
    assert all(part.is_valid for part in parts)
    assert sum(part.area for part in parts) == pytest.approx(whole.area, rel=1e-6)

"""Rotated rectangles share what geometry says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely import Polygon

from training.evaluation.rotated_overlap import paired_intersections, paired_iou, rectangle_corners

_SIDE = st.floats(0.05, 12)
_PLACE = st.floats(-4, 4)
_RECTANGLE = st.tuples(_PLACE, _PLACE, _SIDE, _SIDE, st.floats(-7, 7))


@given(_RECTANGLE, _RECTANGLE)
def test_shared_areas_are_those_of_a_geometry_library(a, b):
    shared = paired_intersections(np.array([a]), np.array([b]))[0]
    first, second = (Polygon(rectangle_corners(np.array([r]))[0]) for r in (a, b))
    assert shared == pytest.approx(first.intersection(second).area, abs=1e-7)


@given(_RECTANGLE)
def test_a_rectangle_covers_itself_at_every_pose(a):
    same = np.array([a])
    assert paired_iou(same, same)[0] == pytest.approx(1)
    far = same + np.array([1000, -1000, 0, 0, math.pi])
    assert paired_iou(far, same + np.array([1000, -1000, 0, 0, 0]))[0] == pytest.approx(1)


def test_a_square_turned_by_an_eighth_shares_a_regular_octagon():
    square = np.array([[3.0, 1.0, 2.0, 2.0, 0.0]])
    turned = square + np.array([0, 0, 0, 0, math.pi / 4])
    assert paired_intersections(square, turned)[0] == pytest.approx(8 * (math.sqrt(2) - 1))


def test_touching_distant_and_empty_rectangles_share_nothing():
    one = np.array([[0.0, 0, 2, 2, 0]] * 3)
    other = np.array([[2.0, 0, 2, 2, 0], [50, 0, 2, 2, 1], [0, 0, 0, 2, 0]])
    assert paired_intersections(one, other) == pytest.approx([0, 0, 0])

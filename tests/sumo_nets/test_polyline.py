"""Lines moved and cut."""

import numpy as np
import pytest
import shapely

from sumo_nets import polyline
from sumo_nets.reader import simple_outlines

_BEND = np.array([[0.0, 0, 0], [10, 0, 1], [10, 10, 2]])


def test_right_of_east_is_south():
    line = np.array([[0.0, 0, 5], [10, 0, 6]])
    assert polyline.beside(line, 2) == pytest.approx(np.array([[0, -2, 5], [10, -2, 6]]))


def test_every_piece_keeps_its_distance_round_a_bend():
    moved = polyline.beside(_BEND, 2)
    assert moved[1] == pytest.approx([12, -2, 1])
    assert shapely.LineString(moved[:, :2]).distance(shapely.LineString(_BEND[:, :2])) == pytest.approx(2)


def test_an_offset_line_never_folds_back():
    line = np.array([[0.0, 0, 0], [20, 0, 0], [20.1, 0.02, 0], [40, -8, 0]])
    for end in np.linspace(1, 39, 77):
        part = polyline.beside(line, 3, 0, end)
        assert np.all(np.diff(part[:, 0]) > 0)


def test_pieces_of_a_dense_line_are_short_and_on_the_line():
    dense = polyline.densify(_BEND, 3.0)
    assert np.linalg.norm(np.diff(dense, axis=0), axis=1).max() <= 3.0
    assert shapely.LineString(dense[:, :2]).length == pytest.approx(20)


def test_a_figure_of_eight_falls_into_its_two_loops():
    eight = np.array([[0.0, 0, 1], [4, 4, 1], [4, 0, 1], [0, 4, 1]])
    loops = simple_outlines(eight)
    assert [shapely.Polygon(loop[:, :2]).area for loop in loops] == pytest.approx([4, 4])
    assert all(loop[:, 2] == pytest.approx(1) for loop in loops)

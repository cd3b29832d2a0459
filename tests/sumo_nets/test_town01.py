"""What the streets of town01 must be like."""

import numpy as np


def test_ground_rises_and_falls_by_several_metres(town):
    heights = np.concatenate([lane.centre[:, 2] for lane in town.streets.lanes])
    assert 4 < np.ptp(heights) < 20


def test_it_is_a_small_town_round_the_origin(town):
    points = np.concatenate([lane.centre for lane in town.streets.lanes])[:, :2]
    low, high = points.min(axis=0), points.max(axis=0)
    assert np.all(np.abs(low + high) < 20)
    assert np.all((high - low > 450) & (high - low < 700))
    junctions = {area.id for area in town.streets.areas if area.use == "junction" and "_" not in area.id}
    assert 25 <= len(junctions) <= 40


def test_lanes_of_every_use_are_there(town):
    lanes = town.streets.lanes
    assert {lane.use for lane in lanes} == {"drive", "sidewalk", "crossing"}
    assert {round(lane.speed_mps * 3.6) for lane in lanes if lane.use == "drive" and not lane.internal} == {30, 50}

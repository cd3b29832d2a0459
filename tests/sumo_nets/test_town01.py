"""What the streets of town01 must be like."""

import numpy as np
import pytest
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from sumo_nets import TOWNS, read_town


def _strip(line: np.ndarray, width_m: float) -> shapely.Polygon:
    return shapely.LineString(line[:, :2]).buffer(width_m / 2, cap_style="flat")


def _pieces(line: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    step = np.diff(line, axis=0)
    run = np.linalg.norm(step[:, :2], axis=1)
    return run[run > 0.3], step[run > 0.3, 2]


def test_no_lane_is_steeper_than_eight_percent(town):
    for lane in town.streets.lanes:
        run, rise = _pieces(lane.centre)
        assert np.all(np.abs(rise) <= 0.08 * run), lane.id


def test_shape_points_follow_the_ground_closely(town):
    longest = max(_pieces(lane.centre)[0].max(initial=0) for lane in town.streets.lanes)
    assert longest <= 15


def test_ground_rises_and_falls_by_several_metres(town):
    heights = np.concatenate([lane.centre[:, 2] for lane in town.streets.lanes])
    assert 4 < np.ptp(heights) < 20


def test_streets_that_meet_are_level_with_each_other(town):
    """Everything lies on one surface: points of different parts that are close in plan are close in height."""
    from scipy.spatial import cKDTree

    parts = [lane.centre for lane in town.streets.lanes] + [area.outline for area in town.streets.areas]
    points = np.concatenate(parts)
    pairs = cKDTree(points[:, :2]).query_pairs(0.5, output_type="ndarray")
    assert np.abs(points[pairs[:, 0], 2] - points[pairs[:, 1], 2]).max() < 0.06


def test_every_street_leads_to_every_other(town):
    import sumolib

    edges = [edge for edge in sumolib.net.readNet(str(town.net)).getEdges() if edge.allows("passenger")]
    number = {edge: i for i, edge in enumerate(edges)}
    links = [(number[a], number[b]) for a in edges for b in a.getOutgoing() if b in number]
    graph = csr_matrix((np.ones(len(links)), np.array(links).T), shape=(len(edges), len(edges)))
    assert connected_components(graph, directed=True, connection="strong", return_labels=False) == 1


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


def test_stop_lines_are_lane_ends_with_every_control(town):
    lanes = {lane.id: lane for lane in town.streets.lanes}
    assert {line.control for line in town.streets.stop_lines} == {"signal", "stop", "yield"}
    for line in town.streets.stop_lines:
        centre = lanes[line.lane].centre
        ahead = centre[-1, :2] - centre[-2, :2]
        assert np.allclose(line.position, centre[-1])
        assert np.cos(line.heading_rad) * ahead[0] + np.sin(line.heading_rad) * ahead[1] > 0


def test_no_one_yields_at_a_bend_nor_everyone_at_a_junction(town):
    import sumolib

    net = sumolib.net.readNet(str(town.net))
    for node in net.getNodes():
        arriving = [edge for edge in node.getIncoming() if edge.allows("passenger")]
        controls = {line.lane.rpartition("_")[0]: line.control for line in town.streets.stop_lines}
        held = [edge for edge in arriving if controls.get(edge.getID()) in ("yield", "stop")]
        assert len(held) < len(arriving)
        assert not held or len(arriving) > 2


def test_parking_lots_keep_off_sidewalks_and_driving_lanes(town):
    lanes = [lane for lane in town.streets.lanes if lane.use in ("drive", "sidewalk") and not lane.internal]
    taken = shapely.union_all([_strip(lane.centre, lane.width_m) for lane in lanes])
    lots = [_strip(bay.centre, bay.width_m) for bay in town.streets.parking]
    assert len(lots) >= 60
    for lot in lots:
        assert lot.buffer(-0.03).intersection(taken).area == pytest.approx(0, abs=1e-3)


def test_outlines_do_not_cross_themselves(town):
    for area in town.streets.areas:
        assert shapely.Polygon(area.outline[:, :2]).is_valid, area.id


@pytest.mark.parametrize("name", TOWNS)
def test_a_town_read_by_name_and_by_folder_is_the_same(name):
    by_name = read_town(name)
    by_folder = read_town(by_name.folder)
    assert by_folder.net == by_name.net
    assert len(by_folder.streets.lanes) == len(by_name.streets.lanes)

"""What the streets of every built-in town must be like."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
import shapely
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from sumo_nets import TOWNS, read_town


@pytest.fixture(scope="module", params=TOWNS)
def town(request):
    return read_town(request.param)


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


def test_streets_that_meet_are_level_with_each_other(town):
    """Everything lies on one surface: points of different parts that are close in plan are close in height."""
    from scipy.spatial import cKDTree

    parts = [lane.centre for lane in town.streets.lanes] + [area.outline for area in town.streets.areas]
    points = np.concatenate(parts)
    pairs = cKDTree(points[:, :2]).query_pairs(0.5, output_type="ndarray")
    assert np.abs(points[pairs[:, 0], 2] - points[pairs[:, 1], 2]).max() < 0.5 * 0.08 * 2 + 0.01


def test_every_street_leads_to_every_other(town):
    import sumolib

    edges = [edge for edge in sumolib.net.readNet(str(town.net)).getEdges() if edge.allows("passenger")]
    number = {edge: i for i, edge in enumerate(edges)}
    links = [(number[a], number[b]) for a in edges for b in a.getOutgoing() if b in number]
    graph = csr_matrix((np.ones(len(links)), np.array(links).T), shape=(len(edges), len(edges)))
    assert connected_components(graph, directed=True, connection="strong", return_labels=False) == 1


def test_stop_lines_are_lane_ends_with_every_control(town):
    lanes = {lane.id: lane for lane in town.streets.lanes}
    assert {line.control for line in town.streets.stop_lines} <= {"signal", "stop", "yield"}
    assert town.streets.stop_lines
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
        assert not held or len(node.getNeighboringNodes()) > 2


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


@pytest.mark.parametrize("name", TOWNS[:1])
def test_a_town_read_by_name_and_by_folder_is_the_same(name):
    by_name = read_town(name)
    by_folder = read_town(by_name.folder)
    assert by_folder.net == by_name.net
    assert len(by_folder.streets.lanes) == len(by_name.streets.lanes)


def test_its_files_are_small(town):
    assert sum(path.stat().st_size for path in town.folder.iterdir()) < 2_000_000


def _limits_kmh(name):
    lanes = read_town(name).streets.lanes
    return {round(lane.speed_mps * 3.6) for lane in lanes if lane.use == "drive" and not lane.internal}


def _lanes_of_edges(name):
    edges = [lane.edge for lane in read_town(name).streets.lanes if lane.use == "drive" and not lane.internal]
    return {edges.count(edge) for edge in set(edges)}


def test_there_are_nine_towns_that_all_differ():
    assert len(TOWNS) == 9
    nets = {read_town(name).net.read_bytes() for name in TOWNS}
    assert len(nets) == 9


def test_the_village_has_roundabouts():
    assert len(ET.parse(read_town("town02").net).getroot().findall("roundabout")) >= 2


def test_the_core_has_streets_of_three_lanes_and_many_lights():
    town = read_town("town05")
    assert 3 in _lanes_of_edges("town05")
    assert len({line.lane for line in town.streets.stop_lines if line.control == "signal"}) > 60


def test_the_ring_road_is_fast_and_its_ramps_get_a_lane_to_merge_on():
    assert 80 in _limits_kmh("town06")
    net = ET.parse(read_town("town06").net).getroot()
    merges = [link for link in net.findall("connection") if link.get("to") == "in2c_in2d" and link.get("via")]
    assert sorted((link.get("from"), link.get("toLane")) for link in merges) == [
        ("end2_in2c", "0"),
        ("in2b_in2c", "1"),
        ("in2b_in2c", "2"),
    ]
    assert {link.get("state") for link in merges} == {"M"}  # no vehicle yields: each lane continues as a separate one


def test_the_hills_are_steep_but_no_steeper_than_eight_percent():
    lanes = [lane for lane in read_town("town07").streets.lanes if lane.use == "drive"]
    grade = max((np.abs(rise) / run).max(initial=0) for run, rise in (_pieces(lane.centre) for lane in lanes))
    assert 0.05 < grade <= 0.08


def test_the_directions_of_a_boulevard_keep_a_green_strip_between_them():
    streets = read_town("town09").streets
    lanes = {lane.id: lane for lane in streets.lanes if lane.use == "drive" and not lane.internal}
    apart = []
    for lane in lanes.values():
        start, _, end = lane.edge.partition("_")
        back = [other for other in lanes.values() if other.edge == f"{end}_{start}"]
        if round(lane.speed_mps * 3.6) == 50 and back:
            middle = shapely.Point(lane.centre[len(lane.centre) // 2, :2])
            apart.append(min(shapely.LineString(other.centre[:, :2]).distance(middle) for other in back))
    assert min(apart) > 8

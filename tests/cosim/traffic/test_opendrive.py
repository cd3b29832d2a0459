"""Road coordinates of OpenDRIVE become the world coordinates that the curves' equations give."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from cosim.traffic.opendrive import OpenDriveError, RoadNetwork, read_road_network

WIDTH = '<width sOffset="0" a="{}" b="{}" c="0" d="0"/>'
LINE = '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'


def lane(number: int, width_m: float = 3.5, growth: float = 0.0, link: str = "") -> str:
    return f'<lane id="{number}" type="driving" level="false">{link}{WIDTH.format(width_m, growth)}</lane>'


def linked(before: int | None = None, after: int | None = None) -> str:
    ends = [f'<predecessor id="{before}"/>'] if before is not None else []
    ends += [f'<successor id="{after}"/>'] if after is not None else []
    return f"<link>{''.join(ends)}</link>"


def section(s_m: float, *lanes: str) -> str:
    sides = {"left": "", "right": ""}
    for text in lanes:
        sides["right" if 'lane id="-' in text else "left"] += text
    centre = '<center><lane id="0" type="none" level="false"/></center>'
    return f'<laneSection s="{s_m}"><left>{sides["left"]}</left>{centre}<right>{sides["right"]}</right></laneSection>'


def road(
    number: str,
    sections: str,
    geometry: str = LINE,
    length: float = 100,
    link: str = "",
    more: str = "",
    **attributes: str,
) -> str:
    others = "".join(f' {key}="{value}"' for key, value in {"junction": "-1", **attributes}.items())
    return (
        f'<road id="{number}" length="{length}"{others}><link>{link}</link><planView>{geometry}</planView>{more}'
        f"<lanes>{sections}</lanes></road>"
    )


def network(folder: Path, *elements: str) -> RoadNetwork:
    path = folder / "road.xodr"
    path.write_text(f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{"".join(elements)}</OpenDRIVE>')
    return read_road_network(path)


def shaped(folder: Path, shape: str, length: float = 40.0, start: str = 'x="0" y="0" hdg="0"') -> np.ndarray:
    """x, y, heading at the end of a reference line of one element."""
    geometry = f'<geometry s="0" {start} length="{length}">{shape}</geometry>'
    lines = network(folder, road("1", section(0, lane(-1)), geometry, length))
    return lines.road("1").plan_view.at(np.array([length]))[0]


def test_an_arc_ends_on_its_circle(tmp_path):
    x, y, heading = shaped(tmp_path, '<arc curvature="0.02"/>')
    assert (x, y, heading) == pytest.approx((50 * math.sin(0.8), 50 * (1 - math.cos(0.8)), 0.8))


def test_a_spiral_is_the_integral_of_its_heading(tmp_path):
    def heading(s: float) -> float:
        return 0.3 - 0.01 * s + (0.05 + 0.01) / 40 * s**2 / 2

    found = shaped(tmp_path, '<spiral curvStart="-0.01" curvEnd="0.05"/>', start='x="5" y="-2" hdg="0.3"')
    x, y = quad(lambda s: math.cos(heading(s)), 0, 40)[0], quad(lambda s: math.sin(heading(s)), 0, 40)[0]
    assert found == pytest.approx((5 + x, -2 + y, heading(40)), abs=1e-9)


@pytest.mark.parametrize(
    ("shape", "length"),
    [
        ('<poly3 a="0" b="0" c="0.01" d="0"/>', None),
        ('<paramPoly3 pRange="normalized" aU="0" bU="30" cU="0" dU="0" aV="0" bV="0" cV="9" dV="0"/>', None),
    ],
)
def test_polynomials_are_followed_by_arc_length(shape, length, tmp_path):
    """Both are the parabola v = 0.01 u² from u = 0 to 30 m."""
    length = quad(lambda u: math.hypot(1, 0.02 * u), 0, 30)[0]
    geometry = f'<geometry s="0" x="0" y="0" hdg="0" length="{length}">{shape}</geometry>'
    plan = network(tmp_path, road("1", section(0, lane(-1)), geometry, length)).road("1").plan_view
    assert plan.at(np.array([length]))[0] == pytest.approx((30, 9, math.atan(0.6)), abs=1e-3)
    half = quad(lambda u: math.hypot(1, 0.02 * u), 0, 15)[0]
    assert plan.at(np.array([half]))[0, :2] == pytest.approx((15, 2.25), abs=1e-3)


def test_lanes_are_next_to_the_shifted_centre_on_the_rolled_road(tmp_path):
    more = (
        '<elevationProfile><elevation s="0" a="2" b="0.05" c="0" d="0"/></elevationProfile>'
        '<lateralProfile><superelevation s="0" a="0.1" b="0" c="0" d="0"/></lateralProfile>'
    )
    shift = '<laneOffset s="0" a="1" b="0" c="0" d="0"/>'
    roads = network(tmp_path, road("1", shift + section(0, lane(1), lane(-1, 3.0), lane(-2, 2.0, 0.02)), more=more))
    t_m = 1 - 3.0 - (2.0 + 0.02 * 40) / 2 + 0.25
    x, y, z, heading = roads.pose(roads.location("1", -2, 40.0, 0.25))
    assert (x, y, z) == pytest.approx((40, t_m * math.cos(0.1), 4 + t_m * math.sin(0.1)))
    assert heading == pytest.approx(math.atan(-0.01), abs=1e-6), "the middle of a widening lane"
    assert roads.pose(roads.location("1", 1, 40.0, 0.0))[3] == pytest.approx(math.pi), "traffic on the left comes back"


def test_left_hand_traffic_faces_along_s_on_the_left(tmp_path):
    roads = network(tmp_path, road("1", section(0, lane(1), lane(-1)), rule="LHT"))
    assert roads.pose(roads.location("1", 1, 40.0, 0.0))[3] == pytest.approx(0.0)


def test_a_way_follows_links_of_sections_and_roads(tmp_path):
    """Lane -2 of road a becomes -1 halfway, and goes on against s of road b, whose end touches that of a."""
    sections = section(0, lane(-1), lane(-2, link=linked(after=-1))) + section(50, lane(-1, link=linked(after=1)))
    onto = '<successor elementType="road" elementId="b" contactPoint="end"/>'
    first = road("a", sections, link=onto)
    geometry = '<geometry s="0" x="200" y="0" hdg="3.141592653589793" length="100"><line/></geometry>'
    second = road("b", section(0, lane(1), lane(-1)), geometry)
    roads = network(tmp_path, first, second)
    location, left_m = roads.advance(roads.location("a", -2, 10.0, -0.5), 100.0)
    assert (location.road, location.lane, location.travel, location.s_m, left_m) == (
        "b",
        1,
        -1,
        pytest.approx(90.0),
        0.0,
    )
    assert roads.pose(location)[:2] == pytest.approx((110, -1.75 - 0.5)) and math.cos(roads.pose(location)[3]) > 0.999
    assert roads.advance(location, 200.0)[1] == pytest.approx(110.0), "beyond the end of the last road"


def test_a_junction_with_two_ways_on_ends_a_way(tmp_path):
    onto = '<successor elementType="junction" elementId="j"/>'
    ways = "".join(
        f'<connection id="{name}" incomingRoad="a" connectingRoad="{name}" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection>'
        for name in ("left", "right")
    )
    arms = [road(name, section(0, lane(-1)), junction="j") for name in ("left", "right")]
    roads = network(tmp_path, road("a", section(0, lane(-1)), link=onto), *arms, f'<junction id="j">{ways}</junction>')
    location, left_m = roads.advance(roads.location("a", -1, 90.0, 0.0), 30.0)
    assert (location.s_m, left_m) == (pytest.approx(100.0), pytest.approx(20.0))
    assert {each.road for each in roads.onward(location)} == {"left", "right"}


def test_locations_follow_from_world_coordinates(tmp_path):
    geometry = '<geometry s="0" x="10" y="0" hdg="0.5" length="60"><arc curvature="-0.01"/></geometry>'
    roads = network(tmp_path, road("1", section(0, lane(1), lane(-1), lane(-2)), geometry, 60))
    for lane_id, s_m in ((-2, 3.0), (-1, 31.7), (1, 55.0)):
        location = roads.location("1", lane_id, s_m, 0.4)
        found = roads.locate(*roads.pose(location)[:2])
        assert found is not None and (found.lane, found.travel) == (lane_id, location.travel)
        assert (found.s_m, found.offset_m) == (pytest.approx(s_m, abs=1e-6), pytest.approx(0.4, abs=1e-6))
    assert roads.locate(500.0, 0.0) is None


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ("<line/>", "no line, arc, spiral"),
        ('length="100"', "length' is missing"),
        ('s="0" x="0"', "is nan"),
        ("<geometry", "no geometry"),
    ],
)
def test_what_is_wrong_in_a_road_is_named(changed, says, tmp_path):
    text = road("1", section(0, lane(-1)))
    new = {"<line/>": "<bow/>", 'length="100"': "", 's="0" x="0"': 's="0" x="nan"', "<geometry": "<outline"}[changed]
    text = text.replace(changed, new).replace("</geometry>", "</outline>" if "outline" in new else "</geometry>")
    with pytest.raises(OpenDriveError, match=says):
        network(tmp_path, text)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("2", -1, 5.0, 0.0), "has no road '2'"),
        (("1", -2, 5.0, 0.0), "has no lane -2 at s = 5 m; its lanes there: -1"),
        (("1", -1, 101.0, 0.0), "is 100 m long"),
    ],
)
def test_locations_that_do_not_exist_are_refused(arguments, says, tmp_path):
    roads = network(tmp_path, road("1", section(0, lane(-1))))
    with pytest.raises(OpenDriveError, match=says):
        roads.location(*arguments)
    assert replace(roads.location("1", -1, 100.005, 0.0)).s_m == 100.0, "rounding of the length is allowed"

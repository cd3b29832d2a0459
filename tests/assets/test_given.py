"""Buildings and trees of a scenario have its positions and heights."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from assets.materials import MATERIAL_NAMES
from assets.streets import StreetBuilding, StreetLane, Streets
from assets.world.build import build_world
from sensors.bvh import Bvh
from sumo_nets.errors import TownError
from sumo_nets.scenery import read_scenery

L_SHAPE = np.array([[40, 12], [65, 12], [65, 20], [52, 20], [52, 32], [40, 32]], float)
SCENERY = """<additional>
<poly id="l" type="building.house" shape="40,12 65,12 65,20 52,20 52,32 40,32">
<param key="height" value="7.5 m"/></poly>
<poly id="box" type="building" shape="80,-12 100,-12 100,-24 80,-24 80,-12">
<param key="building:levels" value="4"/></poly>
<poly id="far" type="building" geo="true" shape="8.4,49.0 8.5,49.0 8.5,49.1"/>
<poly id="w" type="landuse.forest" shape="10,40 60,40 60,80 10,80"/>
<poly id="p" type="parking" shape="0,0 1,0 1,1"/>
<poi id="t" type="natural.tree" x="20" y="9"/><poi id="shop" type="shop" x="0" y="0"/>
</additional>"""


@pytest.fixture(scope="module")
def scenery(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenery") / "s.add.xml"
    path.write_text(SCENERY)
    return read_scenery([path])


@pytest.fixture(scope="module")
def world(scenery):
    centre = np.array([[-20, 0, 0], [140, 0, 0]], float)
    lane = StreetLane("a_0", "a", "drive", centre, 6.0, 13.9, False)
    buildings, trees = scenery
    return build_world(Streets("road", (lane,), (), (), (), buildings=buildings, trees=trees), seed=1)


def test_polygons_are_recognised_by_their_types(scenery):
    buildings, trees = scenery
    assert [(one.id, one.height_m) for one in buildings] == [("l", 7.5), ("box", 12.0)]
    assert np.array_equal(buildings[0].outline, L_SHAPE) and len(buildings[1].outline) == 4
    assert (20.0, 9.0) in trees
    woods = [spot for spot in trees if spot != (20.0, 9.0)]
    assert 30 < len(woods) < 60 and all(10 <= x <= 60 and 40 <= y <= 80 for x, y in woods)


def down_on(mesh, points):
    """What a ray from the sky meets: heights and materials."""
    start = np.column_stack([points, np.full(len(points), 60.0)]).astype(np.float32)
    down = np.tile(np.array([[0, 0, -1]], np.float32), (len(start), 1))
    distance, triangle = Bvh(mesh).first_hit(start, down, np.full(len(start), 100, np.float32))
    return 60.0 - distance, [MATERIAL_NAMES[mesh.materials[row]] if row >= 0 else "" for row in triangle]


def test_roofs_are_where_the_outline_is_and_as_high_as_said(world):
    grid = np.array([[x, y] for x in np.arange(30, 75, 1.7) for y in np.arange(8.3, 38, 1.7)])
    inside = shapely.contains_xy(shapely.Polygon(L_SHAPE).buffer(-0.3), *grid.T)
    outside = ~shapely.contains_xy(shapely.Polygon(L_SHAPE).buffer(0.3), *grid.T)
    height, material = down_on(world.mesh, grid)
    roof = np.array([name == "roof_flat" for name in material])
    assert roof[inside].mean() > 0.97 and not roof[outside].any()  # crowns may hang over
    assert np.allclose(height[inside & roof], 7.65, atol=0.2)


def test_no_other_building_is_there(world):
    roofs = world.mesh.materials == MATERIAL_NAMES.index("roof_flat")
    places = world.mesh.triangles[roofs].reshape(-1, 3)
    assert (shapely.contains_xy(shapely.box(39, -25, 101, 33), *places[:, :2].T.astype(float))).all()


def test_the_tree_stands_on_its_spot(world):
    bark = world.mesh.triangles[world.mesh.materials == MATERIAL_NAMES.index("bark")].reshape(-1, 3)
    assert np.linalg.norm(bark[:, :2] - [20, 9], axis=1).min() < 0.3


@pytest.mark.parametrize(
    ("element", "says"),
    [
        ('<poly id="x" type="building" shape="1,2 three,4 5,6"/>', "poly 'x' has a shape"),
        ('<poly id="x" type="building" shape="0,0 9,0 9,9"><param key="height" value="-3"/></poly>', "height -3"),
        ('<poi id="x" type="tree" x="here" y="0"/>', "poi 'x' has x 'here'"),
    ],
)
def test_broken_scenery_is_refused(element, says, tmp_path):
    (tmp_path / "s.xml").write_text(f"<additional>{element}</additional>")
    with pytest.raises(TownError, match=says):
        read_scenery([tmp_path / "s.xml"])


def test_an_outline_that_encloses_nothing_is_passed_over():
    line = StreetBuilding("line", np.array([[0, 20], [9, 20], [4, 20]], float), 5.0)
    lane = StreetLane("a_0", "a", "drive", np.array([[0, 0, 0], [60, 0, 0]], float), 6.0, 13.9, False)
    assert len(build_world(Streets("road", (lane,), (), (), (), buildings=(line,)), seed=1).mesh.faces)

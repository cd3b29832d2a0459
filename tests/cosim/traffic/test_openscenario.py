"""Trajectories of OpenSCENARIO files are replayed; other files are refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.traffic.trajectories import Replay, TrajectoryError, read_trajectories
from tests.cosim.traffic.test_trajectories import along

REAR_AXLE_M = 1.4  # the middle of the box lies so far ahead of it
CAR = f"""<Vehicle name="saloon" vehicleCategory="car"><BoundingBox><Center x="{REAR_AXLE_M}" y="0" z="0.75"/>
<Dimensions width="1.8" length="4.4" height="1.5"/></BoundingBox>
<Performance maxSpeed="60" maxAcceleration="5" maxDeceleration="9"/><Axles>
<FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles>
<Properties/></Vehicle>"""
WALKER = """<Pedestrian name="walker" model="w" mass="80" pedestrianCategory="pedestrian"><BoundingBox>
<Center x="0" y="0" z="0.9"/><Dimensions width="0.6" length="0.5" height="1.8"/></BoundingBox>
<Properties/></Pedestrian>"""
CONE = """<MiscObject name="cone" mass="1" miscObjectCategory="obstacle"><BoundingBox><Center x="0" y="0" z="0.4"/>
<Dimensions width="0.3" length="0.3" height="0.8"/></BoundingBox><Properties/></MiscObject>"""
HEAD = '<FileHeader revMajor="1" revMinor="1" date="2024-01-01T00:00:00" description="d" author="a"/>'
AT = """<StartTrigger><ConditionGroup><Condition name="t" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="{}" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>
</StartTrigger>"""


def location(xy: np.ndarray, heading_rad: float) -> str:
    x, y = xy
    return f'<Position><WorldPosition x="{x:.6f}" y="{y:.6f}" z="0" h="{heading_rad:.6f}"/></Position>'


def follows(vertices: list[tuple[float, np.ndarray]], heading_rad: float, domain: str = "absolute") -> str:
    line = "".join(f'<Vertex time="{time}">{location(xy, heading_rad)}</Vertex>' for time, xy in vertices)
    return f"""<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>
<Trajectory name="way" closed="false"><Shape><Polyline>{line}</Polyline></Shape></Trajectory></TrajectoryRef>
<TimeReference><Timing domainAbsoluteRelative="{domain}" scale="1" offset="0"/></TimeReference>
<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>"""


def teleport(position: str) -> str:
    return f"<PrivateAction><TeleportAction>{position}</TeleportAction></PrivateAction>"


def scenario(folder: Path, init: dict[str, str], story: dict[str, str], start_s: str = "0", **entities: str) -> Path:
    """A file of entities, with initial actions and actions of an act that starts at a time."""
    objects = "".join(f'<ScenarioObject name="{name}">{text}</ScenarioObject>' for name, text in entities.items())
    begins = "".join(f'<Private entityRef="{name}">{text}</Private>' for name, text in init.items())
    groups = "".join(
        f"""<ManeuverGroup name="g{name}" maximumExecutionCount="1"><Actors selectTriggeringEntities="false">
<EntityRef entityRef="{name}"/></Actors><Maneuver name="m"><Event name="e" priority="overwrite"><Action name="a">{text}
</Action>{AT.format(0)}</Event></Maneuver></ManeuverGroup>"""
        for name, text in story.items()
    )
    report = f'<Story name="s"><Act name="act">{groups}{AT.format(start_s)}</Act></Story>' if story else ""
    parameters = '<ParameterDeclaration name="start" parameterType="double" value="3"/>'
    path = folder / "scenario.xosc"
    path.write_text(
        f"<OpenSCENARIO>{HEAD}<ParameterDeclarations>{parameters}</ParameterDeclarations><CatalogLocations/>"
        f"<RoadNetwork/><Entities>{objects}</Entities>"
        f"<Storyboard><Init><Actions>{begins}</Actions></Init>{report}<StopTrigger/></Storyboard></OpenSCENARIO>"
    )
    return path


@pytest.fixture
def lane(hamlet):
    start, way = along(hamlet)
    return start, way, float(np.arctan2(way[1], way[0]))


def test_entities_are_where_their_trajectories_have_them(hamlet, lane, tmp_path):
    """A car waits 3 s and then drives at 5 m/s, given by two vertices and a parameter; a pedestrian does not move."""
    start, way, heading = lane
    vertices = [(0.0, start), (6.0, start + 30 * way)]
    beside = start + 4 * np.array([-way[1], way[0]])
    path = scenario(
        tmp_path,
        {"ego": teleport(location(start, heading)), "walker": teleport(location(beside, 0.0))},
        {"ego": follows(vertices, heading, "relative")},
        start_s="$start",
        ego=CAR,
        walker=WALKER,
        cone=CONE,
    )
    replay = Replay(read_trajectories(path, hamlet.streets))
    assert replay.tracks.ids == ("ego", "walker") and replay.tracks.kinds == ("car", "pedestrian")
    assert replay.life("ego") == (0.0, 9.0)
    for time_s, driven_m in ((1.0, 0.0), (5.0, 10.0), (8.0, 25.0)):
        actors = replay.at(time_s)
        front = start + way * (driven_m + REAR_AXLE_M + 2.2)
        assert np.allclose(actors.front[0, :2], front, atol=0.02)
        assert actors.speed_mps[0] == pytest.approx(5.0 if driven_m else 0.0, abs=0.05)
        assert np.allclose(actors.front[1, :2], beside, atol=1e-5) and actors.parked[1]


def test_absolute_times_are_those_of_the_simulation(hamlet, lane, tmp_path):
    start, way, heading = lane
    report = follows([(2.0, start), (4.0, start + 16 * way)], heading)
    path = scenario(tmp_path, {}, {"ego": report}, start_s="1", ego=CAR)
    assert Replay(read_trajectories(path, hamlet.streets)).life("ego") == (2.0, 4.0)


def test_vehicles_of_catalogues_are_detected(hamlet, lane, tmp_path):
    start, way, heading = lane
    (tmp_path / "cars").mkdir()
    (tmp_path / "cars/c.xosc").write_text(f'<OpenSCENARIO>{HEAD}<Catalog name="cars">{CAR}</Catalog></OpenSCENARIO>')
    named = '<CatalogReference catalogName="cars" entryName="{}"/>'
    report = follows([(0.0, start), (4.0, start + 16 * way)], heading)
    path = scenario(tmp_path, {"ego": report}, {}, ego=named.format("saloon"))
    where = '<CatalogLocations><VehicleCatalog><Directory path="cars"/></VehicleCatalog></CatalogLocations>'
    path.write_text(path.read_text().replace("<CatalogLocations/>", where))
    tracks = read_trajectories(path, hamlet.streets).size
    assert np.allclose(tracks, [[4.4, 1.8, 1.5]])
    path.write_text(path.read_text().replace("saloon", "coupe"))
    with pytest.raises(TrajectoryError, match="'coupe' of catalogue 'cars' is in no folder"):
        read_trajectories(path, hamlet.streets)


LANE_CHANGE = """<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics
value="3" dynamicsShape="sinusoidal" dynamicsDimension="time"/>
<LaneChangeTarget><AbsoluteTargetLane value="-1"/></LaneChangeTarget>
</LaneChangeAction></LateralAction></PrivateAction>"""
ON_LANE = '<Position><LanePosition roadId="1" laneId="-1" s="3" offset="0"/></Position>'


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("<Action name", f'<Action name="b">{LANE_CHANGE}</Action><Action name', "changes lane after its trajectory"),
        (
            "<Init><Actions>",
            f'<Init><Actions><Private entityRef="ego">{teleport(ON_LANE)}</Private>',
            "names no OpenDRIVE file",
        ),
        (' time="6.0"', "", "scenariogeneration cannot parse"),
        ('scale="1" offset="0"', "", "scenariogeneration cannot parse"),
        (' time="6.0"', ' time="-6.0"', "do not grow"),
        ('rule="greaterThan"', 'rule="lessThan"', "starts when a traffic condition is met"),
        ('value="0"', 'value="$unheard"', r"\$unheard is not declared before its use"),
        ('offset="0"', 'offset="${1 + import}"', "no arithmetic expression"),
        ("<Storyboard>", "<Story>", "not well-formed"),
        ("<Entities>", "<Entities><ScenarioObject/>", "scenariogeneration cannot parse"),
    ],
)
def test_what_only_a_simulator_could_tell_is_refused_in_one_line(old, new, says, hamlet, lane, tmp_path):
    start, way, heading = lane
    report = follows([(0.0, start), (6.0, start + 30 * way)], heading, "relative")
    path = scenario(tmp_path, {}, {"ego": report}, ego=CAR)
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(Exception, match=says) as caught:
        read_trajectories(path, hamlet.streets)
    assert "\n" not in str(caught.value) and type(caught.value).__name__ in ("TrajectoryError", "TownError")


LENGTH = '<ParameterDeclaration name="L" parameterType="double" value="{}"/>'


@pytest.mark.parametrize(
    ("declared", "used", "assigned", "length_m"),
    [
        ("4.5", "$L", "", 4.5),
        ("4.5", "$L", '<ParameterAssignment parameterRef="L" value="5.1"/>', 5.1),
        ("4.5", "$L", '<ParameterAssignment parameterRef="L" value="$start"/>', 3.0),
        ("4.5", "${$L * 2 - round(3.6)}", "", 5.0),
    ],
)
def test_parameters_of_catalogue_entries_are_resolved_by_scope(
    declared, used, assigned, length_m, hamlet, lane, tmp_path
):
    start, way, heading = lane
    entry = CAR.replace(
        "<BoundingBox>", f"<ParameterDeclarations>{LENGTH.format(declared)}</ParameterDeclarations><BoundingBox>"
    )
    entry = entry.replace('length="4.4"', f'length="{used}"')
    (tmp_path / "c.xosc").write_text(f'<OpenSCENARIO>{HEAD}<Catalog name="cars">{entry}</Catalog></OpenSCENARIO>')
    values = f"<ParameterAssignments>{assigned}</ParameterAssignments>" if assigned else ""
    reference = f'<CatalogReference catalogName="cars" entryName="saloon">{values}</CatalogReference>'
    follow = follows([(0.0, start), (6.0, start + 30 * way)], heading)
    path = scenario(tmp_path, {}, {"ego": follow}, ego=reference)
    catalogs = '<CatalogLocations><VehicleCatalog><Directory path="."/></VehicleCatalog></CatalogLocations>'
    path.write_text(path.read_text().replace("<CatalogLocations/>", catalogs))
    assert read_trajectories(path, hamlet.streets).size[0, 0] == pytest.approx(length_m)


def test_an_entry_that_cannot_be_parsed_is_named(hamlet, lane, tmp_path):
    start, _, heading = lane
    entry = CAR.replace('length="4.4"', 'length="long"')
    (tmp_path / "c.xosc").write_text(f'<OpenSCENARIO>{HEAD}<Catalog name="cars">{entry}</Catalog></OpenSCENARIO>')
    reference = '<CatalogReference catalogName="cars" entryName="saloon"/>'
    path = scenario(tmp_path, {"ego": teleport(location(start, heading))}, {}, ego=reference)
    catalogs = '<CatalogLocations><VehicleCatalog><Directory path="."/></VehicleCatalog></CatalogLocations>'
    path.write_text(path.read_text().replace("<CatalogLocations/>", catalogs))
    with pytest.raises(TrajectoryError, match=r"c.xosc: scenariogeneration cannot parse Vehicle 'saloon'"):
        read_trajectories(path, hamlet.streets)

"""Scenarios in lane coordinates: initial locations, and vehicles that keep lane and speed between actions."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from cosim.traffic.trajectories import Replay, TrajectoryError, read_trajectories
from tests.cosim.traffic.test_opendrive import lane, road, section
from tests.cosim.traffic.test_openscenario import CAR, REAR_AXLE_M, WALKER, location, scenario, teleport
from tests.cosim.traffic.test_trajectories import along

ROAD_M, LANE_M = 60.0, 3.2
FRONT_M = REAR_AXLE_M + 2.2  # of the front bumper, ahead of the rear axle
SPEED = """<PrivateAction><LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>
<SpeedActionTarget><AbsoluteTargetSpeed value="{mps}"/></SpeedActionTarget></SpeedAction></LongitudinalAction>
</PrivateAction>"""
RELATIVE_SPEED = """<PrivateAction><LongitudinalAction><SpeedAction>
<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
<SpeedActionTarget><RelativeTargetSpeed entityRef="{entity}" value="{value}" speedTargetValueType="{kind}"
continuous="true"/></SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>"""
LANE_CHANGE = """<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics value="2"
dynamicsShape="sinusoidal" dynamicsDimension="time"/><LaneChangeTarget>{}</LaneChangeTarget></LaneChangeAction>
</LateralAction></PrivateAction>"""
ASSIGN = """<PrivateAction><ControllerAction><AssignControllerAction activateLateral="true" activateLongitudinal="true">
<Controller name="joystick"><Properties/></Controller></AssignControllerAction></ControllerAction></PrivateAction>"""
STOP = """<StopTrigger><ConditionGroup><Condition name="end" delay="0" conditionEdge="none"><ByValueCondition>
<SimulationTimeCondition value="6" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup></StopTrigger>"""


def speed(mps: float, shape: str = "step", value: float = 0.0, dimension: str = "time") -> str:
    return SPEED.format(shape=shape, dimension=dimension, value=value, mps=mps)


def on_lane(number: int, s_m: float, more: str = "") -> str:
    return f'<Position><LanePosition roadId="1" laneId="{number}" s="{s_m}">{more}</LanePosition></Position>'


class Street:
    """A straight road of OpenDRIVE along a street of the town, two lanes to each side."""

    def __init__(self, hamlet, folder: Path) -> None:
        self.town, self.folder = hamlet, folder
        self.start, self.way = along(hamlet)
        heading = math.atan2(self.way[1], self.way[0])
        x, y = self.start
        geometry = f'<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="{ROAD_M}"><line/></geometry>'
        lanes = section(0, *(lane(number, LANE_M) for number in (1, 2, -1, -2)))
        (folder / "street.xodr").write_text(f"<OpenDRIVE>{road('1', lanes, geometry, ROAD_M)}</OpenDRIVE>")

    def at(self, s_m: float, t_m: float) -> np.ndarray:
        return self.start + s_m * self.way + t_m * np.array([-self.way[1], self.way[0]])

    def read(self, init: dict[str, str], story: dict[str, str], **entities: str) -> Replay:
        path = scenario(self.folder, init, story, start_s="2", **entities)
        text = path.read_text().replace(
            "<RoadNetwork/>", '<RoadNetwork><LogicFile filepath="street.xodr"/></RoadNetwork>'
        )
        path.write_text(text.replace("<StopTrigger/></Storyboard>", f"{STOP}</Storyboard>"))
        return Replay(read_trajectories(path, self.town.streets))


@pytest.fixture
def street(hamlet, tmp_path):
    return Street(hamlet, tmp_path)


def front(replay: Replay, name: str, time_s: float) -> np.ndarray:
    actors = replay.at(time_s)
    return actors.front[list(actors.ids).index(name), :2]


def test_a_vehicle_keeps_its_lane_and_speed(street):
    replay = street.read({"ego": teleport(on_lane(-1, 5)) + speed(4.0)}, {}, ego=CAR)
    assert replay.life("ego") == pytest.approx((0.0, 6.0), abs=0.11)
    for time_s in (0.5, 3.0, 5.5):
        assert front(replay, "ego", time_s) == pytest.approx(street.at(5 + 4 * time_s + FRONT_M, -LANE_M / 2), abs=0.02)


def test_vehicles_on_the_left_come_back_and_leave_at_the_end_of_the_road(street):
    replay = street.read({"ego": teleport(on_lane(1, 20)) + speed(8.0)}, {}, ego=CAR)
    assert front(replay, "ego", 1.0) == pytest.approx(street.at(20 - 8 - FRONT_M, LANE_M / 2), abs=0.02)
    assert replay.life("ego")[1] == pytest.approx(2.5, abs=0.15)
    assert any("'ego' leaves at the end of road '1'" in note for note in replay.tracks.notes)


@pytest.mark.parametrize(
    ("shape", "value", "dimension", "driven_m"),
    [
        ("linear", 2.0, "time", 4 * 2 + 6 * 2 + 8 * 1),
        ("sinusoidal", 2.0, "time", 4 * 2 + 6 * 2 + 8 * 1),
        ("cubic", 2.0, "time", 4 * 2 + 6 * 2 + 8 * 1),
        ("linear", 12.0, "distance", 4 * 2 + 12 + 8 * 1),
        ("linear", 2.0, "rate", 4 * 2 + 6 * 2 + 8 * 1),
        ("step", 0.0, "time", 4 * 2 + 8 * 3),
    ],
)
def test_speed_changes_take_the_time_that_their_dynamics_give(shape, value, dimension, driven_m, street):
    """From 4 to 8 m/s, from 2 s on; the position at 5 s."""
    init = {"ego": teleport(on_lane(-1, 5)) + speed(4.0)}
    replay = street.read(init, {"ego": speed(8.0, shape, value, dimension)}, ego=CAR)
    assert front(replay, "ego", 5.0) == pytest.approx(street.at(5 + driven_m + FRONT_M, -LANE_M / 2), abs=0.05)


def test_the_performance_of_the_vehicle_limits_accelerations(street):
    slow = CAR.replace('maxAcceleration="5"', 'maxAcceleration="1"')
    init = {"ego": teleport(on_lane(-1, 5)) + speed(4.0)}
    replay = street.read(init, {"ego": speed(7.0, "linear", 0.5)}, ego=slow)
    assert front(replay, "ego", 5.0) == pytest.approx(street.at(5 + 8 + 5.5 * 3 + FRONT_M, -LANE_M / 2), abs=0.05)


@pytest.mark.parametrize(
    "target", ['<AbsoluteTargetLane value="-2"/>', '<RelativeTargetLane entityRef="ego" value="-1"/>']
)
def test_a_lane_change_keeps_the_speed_and_faces_along_the_way(target, street):
    init = {"ego": teleport(on_lane(-1, 5)) + speed(6.0)}
    replay = street.read(init, {"ego": LANE_CHANGE.format(target)}, ego=CAR)
    sideways_mps = math.pi / 2 * LANE_M / 2  # in the middle of the change
    actors = replay.at(3.0)
    turned = math.asin(sideways_mps / 6.0)
    heading = math.atan2(street.way[1], street.way[0])
    assert (actors.heading_rad[0] - heading + math.pi) % (2 * math.pi) - math.pi == pytest.approx(-turned, abs=0.02)
    assert actors.speed_mps[0] == pytest.approx(6.0, abs=0.1)
    ahead = (front(replay, "ego", 5.0) - street.at(0, -1.5 * LANE_M)) @ street.way
    assert front(replay, "ego", 5.0) == pytest.approx(street.at(ahead, -1.5 * LANE_M), abs=0.02)
    assert 5 + 28.5 < ahead - FRONT_M < 5 + 30, "a little less than 6 m/s along the lane"


@pytest.mark.parametrize(
    ("position", "s_m", "t_m", "turned"),
    [
        ('<LanePosition roadId="1" laneId="-1" s="9" offset="0.5"/>', 9, -LANE_M / 2 + 0.5, 0.0),
        ('<LanePosition roadId="1" laneId="1" s="9"/>', 9, LANE_M / 2, math.pi),
        ('<RoadPosition roadId="1" s="9" t="1.0"/>', 9, 1.0, 0.0),
        ('<RelativeLanePosition entityRef="lead" ds="4" dLane="1"/>', 24, LANE_M / 2, 0.0),
        ('<RelativeLanePosition entityRef="lead" dsLane="-4" dLane="-1"/>', 16, -1.5 * LANE_M, 0.0),
        ('<RelativeRoadPosition entityRef="lead" ds="-4" dt="-1"/>', 16, -LANE_M / 2 - 1, 0.0),
        ('<RelativeObjectPosition entityRef="lead" dx="-4" dy="1"/>', 16, -LANE_M / 2 + 1, 0.0),
        (
            '<LanePosition roadId="1" laneId="-1" s="9"><Orientation type="relative" h="1.5"/></LanePosition>',
            9,
            -LANE_M / 2,
            1.5,
        ),
    ],
)
def test_positions_are_those_of_their_coordinate_system(position, s_m, t_m, turned, street):
    init = {
        "walker": teleport(f"<Position>{position}</Position>"),
        "lead": teleport(on_lane(-1, 20)) + speed(3.0),
    }
    replay = street.read(init, {}, lead=CAR, walker=WALKER)
    assert front(replay, "walker", 1.0) == pytest.approx(street.at(s_m, t_m), abs=1e-5)
    actors = replay.at(1.0)
    heading = actors.heading_rad[list(actors.ids).index("walker")] - math.atan2(street.way[1], street.way[0])
    assert math.cos(heading - turned) == pytest.approx(1.0, abs=1e-6)


def test_relative_positions_refer_to_the_one_before(street):
    turned = '<Orientation type="relative" h="3.141592653589793"/>'
    back = f'<RelativeRoadPosition entityRef="walker" ds="2" dt="0">{turned}</RelativeRoadPosition>'
    init = {"walker": teleport(on_lane(-1, 9)) + teleport(f"<Position>{back}</Position>")}
    replay = street.read({**init, "ego": teleport(on_lane(-2, 9)) + speed(3.0)}, {}, ego=CAR, walker=WALKER)
    assert front(replay, "walker", 1.0) == pytest.approx(street.at(11, -LANE_M / 2), abs=1e-5)


@pytest.mark.parametrize(("kind", "value"), [("delta", 2.0), ("factor", 1.5)])
def test_a_speed_relative_to_a_constant_one_is_computed(kind, value, street):
    init = {
        "ego": teleport(on_lane(-1, 5)) + RELATIVE_SPEED.format(entity="lead", value=value, kind=kind),
        "lead": teleport(on_lane(-2, 20)) + speed(4.0),
    }
    replay = street.read(init, {}, lead=CAR, ego=CAR)
    assert front(replay, "ego", 4.0) == pytest.approx(street.at(5 + 24 + FRONT_M, -LANE_M / 2), abs=0.02)


def test_a_path_without_times_is_followed_at_the_own_speed(street):
    heading = math.atan2(street.way[1], street.way[0])
    vertices = "".join(f"<Vertex>{location(street.at(s_m, -1), heading)}</Vertex>" for s_m in (10, 20, 40))
    follow = f"""<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="way"
closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference><None/>
</TimeReference><TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>
</PrivateAction>"""
    replay = street.read({"ego": speed(5.0) + follow}, {}, ego=CAR)
    assert front(replay, "ego", 4.0) == pytest.approx(street.at(30 + FRONT_M, -1), abs=0.02)


@pytest.mark.parametrize(
    ("init", "story", "says"),
    [
        (on_lane(-3, 5), speed(5.0), "has no lane -3 at s = 5 m; its lanes there: -2, -1, 1, 2"),
        (on_lane(-1, 65), speed(5.0), "road '1' is 60 m long"),
        (on_lane(-1, 5, '<Orientation type="relative" h="1.5"/>'), speed(5.0), "faces across its lane"),
        (on_lane(-1, 5), ASSIGN, r"left to a controller \(joystick\)"),
        (
            on_lane(-1, 5),
            RELATIVE_SPEED.format(entity="ego", value=1.0, kind="delta"),
            "relative to one that is relative",
        ),
        (on_lane(-1, 5), LANE_CHANGE.format('<AbsoluteTargetLane value="4"/>'), "way of 'ego': road '1' has no lane 4"),
        ('<Position><RelativeLanePosition entityRef="ego" ds="1" dLane="0"/></Position>', "", "refer to each other"),
        (
            f"{on_lane(-1, 5)}",
            LANE_CHANGE.format('<RelativeTargetLane entityRef="cat" value="1"/>'),
            "relative to 'cat'",
        ),
    ],
)
def test_what_the_file_does_not_determine_is_refused(init, story, says, street):
    with pytest.raises(TrajectoryError, match=says) as caught:
        street.read({"ego": teleport(init)}, {"ego": story} if story else {}, ego=CAR)
    assert "\n" not in str(caught.value)


def test_conditions_on_traffic_are_named(street):
    path = scenario(street.folder, {"ego": teleport(on_lane(-1, 5))}, {"ego": speed(5.0)}, ego=CAR)
    met = """<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="ego"/>
</TriggeringEntities><EntityCondition><StandStillCondition duration="1"/></EntityCondition></ByEntityCondition>"""
    old = """<ByValueCondition>
<SimulationTimeCondition value="0" rule="greaterThan"/></ByValueCondition>"""
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, met, 1))
    with pytest.raises(TrajectoryError, match=r"traffic condition is met \(StandStillCondition\)"):
        read_trajectories(path, street.town.streets)

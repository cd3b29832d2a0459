import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cosim.traffic.motion import Motion, TurnError, overlaps, plan_turn
from cosim.traffic.motion.bicycle import MAX_LATERAL_MPS2, BicycleState, follow
from cosim.traffic.motion.body import PITCH_PER_MPS2, Springs
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.corners import corner_speed
from cosim.traffic.motion.turn_path import Room
from cosim.traffic.motion.walking import walk
from tests.cosim.road_users import road_users

STEP_S = 0.1
CAR = np.array([4.3, 1.75, 1.5])


def arc(radius_m: float, turn_rad: float, pieces: int) -> np.ndarray:
    """A polyline: 30 m straight, a corner in some pieces, 30 m straight."""
    angle = np.linspace(0, turn_rad, pieces + 1)
    side = np.sign(turn_rad)
    corner = np.column_stack([radius_m * np.sin(np.abs(angle)), side * radius_m * (1 - np.cos(angle))])
    out = corner[-1] + 30 * np.array([np.cos(turn_rad), np.sin(turn_rad)])
    return np.vstack([[[-30, 0]], corner, [out]])


def drive(path: np.ndarray, speed_mps: float, aside_m: float = 0.0, length_m: float = 4.3) -> tuple[np.ndarray, ...]:
    """Follow a polyline at a speed; front, heading, lateral acceleration and curvature, targets of every step."""
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    chassis = Chassis.of(("car",), np.array([length_m]))
    state = BicycleState(path[:1] - [0.0, aside_m], np.zeros(1), np.zeros(1), np.array([speed_mps]))
    rows, last = [], path[0]
    for s in np.arange(speed_mps * STEP_S, way[-1], speed_mps * STEP_S):
        target = np.array([np.interp(s, way, path[:, i]) for i in (0, 1)])
        tail = np.array([np.interp(max(s - length_m, 0), way, path[:, i]) for i in (0, 1)])
        course = np.arctan2(*(target - tail)[::-1])
        travel = np.arctan2(*(target - last)[::-1])
        state = follow(state, chassis, target[None], np.array([course]), np.array([travel]), STEP_S)
        rows.append(
            (
                *state.front[0],
                state.heading_rad[0],
                state.curvature_per_m[0] * state.speed_mps[0] ** 2,
                state.curvature_per_m[0],
                *target,
            )
        )
        last = target
    rows = np.array(rows)
    return rows[:, :2], rows[:, 2], rows[:, 3:5], rows[:, 5:]


@given(radius=st.floats(5.5, 60), turn=st.floats(-1.7, 1.7), pieces=st.integers(7, 12))
@settings(max_examples=40, deadline=None)
def test_a_car_takes_every_corner_smoothly_and_stays_on_its_lane(radius, turn, pieces):
    # the towns' networks draw a corner with at least seven pieces
    path = arc(radius, turn if abs(turn) > 0.1 else 0.1, pieces)
    speed = min(corner_speed(path), 14.0)
    front, heading, sideways, target = drive(path, speed)
    assert np.degrees(np.abs(np.diff(np.unwrap(heading)))).max() < 6
    assert np.hypot(*(front - target).T).max() < 0.3
    assert np.abs(sideways[:, 0]).max() <= MAX_LATERAL_MPS2 + 1e-9
    assert np.abs(sideways[:, 1]).max() <= np.tan(np.radians(36)) / (0.6 * 4.3) + 1e-9


@given(speed=st.floats(2, 30), aside=st.floats(0.05, 0.6))
@settings(max_examples=30, deadline=None)
def test_a_car_next_to_its_lane_comes_back_without_swinging(speed, aside):
    path = np.array([[0.0, aside], [40 * speed, aside]])
    front, heading, _, _ = drive(path, speed, aside_m=aside)
    late = front[len(front) // 2 :]
    assert np.abs(late[:, 1] - aside).max() < 0.02
    assert front[:, 1].max() < 1.3 * aside + 0.01
    assert np.abs(heading[len(heading) // 2 :]).max() < np.radians(0.5)


def test_who_stands_does_not_turn_or_slide():
    chassis = Chassis.of(("car",), np.array([4.3]))
    state = BicycleState(np.zeros((1, 2)), np.zeros(1), np.zeros(1), np.zeros(1))
    for aside in np.linspace(0, 3.2, 30):
        state = follow(state, chassis, np.array([[0.0, aside]]), np.zeros(1), np.array([np.pi / 2]), STEP_S)
    assert np.array_equal(state.front, np.zeros((1, 2))) and state.heading_rad[0] == 0


@pytest.mark.parametrize("radius", [6.0, 12.0, 40.0])
def test_corners_are_taken_in_comfort(radius):
    speed = corner_speed(arc(radius, 1.5, 24))
    assert speed**2 / radius < 3.1 and speed / radius < 0.65
    assert speed > 0.7 * min(np.sqrt(2.8 * radius), 0.6 * radius)


def test_straight_lanes_have_no_corner_speed():
    assert corner_speed(np.array([[0, 0], [50, 0], [90, 0]])) == np.inf


@given(width=st.floats(9.5, 30), length=st.floats(3.4, 4.8))
@example(width=12.125, length=4.15625)  # the last arc is short
@settings(max_examples=25, deadline=None)
def test_a_turn_ends_in_the_opposite_lane_and_never_leaves_its_room(width, length):
    size = np.array([length, 1.75, 1.5])
    room = Room(right_m=-3.5, left_m=width - 3.5, goal_m=3.2, boxes=np.zeros((0, 5)))
    script = plan_turn(np.array([10.0, 5.0]), 0.4, "car", size, room, STEP_S)
    heading = np.unwrap(script.heading_rad)
    assert np.cos(heading[-1] - 0.4) == pytest.approx(-1, abs=1e-6)
    assert np.degrees(np.abs(np.diff(heading))).max() < 6
    away = script.front - [10.0, 5.0]
    y = away[:, 1] * np.cos(0.4) - away[:, 0] * np.sin(0.4)
    middle = y - length / 2 * np.sin(heading - 0.4)
    reach = length / 2 * np.abs(np.sin(heading - 0.4)) + 0.875 * np.abs(np.cos(heading - 0.4))
    assert (middle + reach).max() <= room.left_m + 0.03 and (middle - reach).min() >= room.right_m - 0.03


def test_a_turn_without_space_is_reported():
    with pytest.raises(TurnError, match=r"4\.3 m cannot turn round within 5\.0 m"):
        plan_turn(np.zeros(2), 0.0, "car", CAR, Room(-1.5, 3.5, 2.5, np.zeros((0, 5))), STEP_S)


def test_a_parked_car_in_the_way_changes_or_forbids_the_turn():
    free = plan_turn(np.zeros(2), 0.0, "car", CAR, Room(-3.5, 7.0, 3.2, np.zeros((0, 5))), STEP_S)
    box = np.array([[1.0, 5.0, 0.0, 4.5, 1.8]])
    try:
        script = plan_turn(np.zeros(2), 0.0, "car", CAR, Room(-3.5, 7.0, 3.2, box), STEP_S)
    except TurnError:
        return
    assert len(script) != len(free)
    forward = np.column_stack([np.cos(script.heading_rad), np.sin(script.heading_rad)])
    for centre, heading in zip(script.front - CAR[0] / 2 * forward, script.heading_rad, strict=True):
        pair = overlaps(np.vstack([centre, box[0, :2]]), np.array([heading, 0.0]), np.array([CAR[:2], box[0, 3:]]))
        assert not len(pair.first)


@given(st.floats(-np.pi, np.pi), st.floats(-3, 3), st.floats(-3, 3), st.floats(-np.pi, np.pi))
@settings(deadline=None)
def test_overlap_does_not_depend_on_the_observer(heading, x, y, turn):
    centre, angle = np.array([[0.0, 0.0], [x, y]]), np.array([0.3, heading])
    size = np.array([[4.0, 1.8], [4.4, 1.7]])
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    one = overlaps(centre, angle, size)
    other = overlaps(centre @ rotation.T + 7, angle + turn, size)
    swapped = overlaps(centre[::-1], angle[::-1], size[::-1])
    if not len(one.depth_m) or one.depth_m[0] > 1e-6:
        assert len(one.first) == len(other.first) == len(swapped.first)
        np.testing.assert_allclose(one.depth_m, other.depth_m, atol=1e-9)


def test_braking_dives_and_settles_at_the_static_angle():
    springs, state = Springs(STEP_S), np.zeros((1, 2, 2))
    angles = []
    for _ in range(60):
        state = springs.step(state, np.array([[-3.0, 0.0]]))
        angles.append(state[0, 0, 0])
    assert max(angles) > angles[-1] > 0
    assert angles[-1] == pytest.approx(3 * PITCH_PER_MPS2, rel=1e-3)


def test_a_left_hand_bend_leans_the_body_to_the_right():
    springs, state = Springs(STEP_S), np.zeros((1, 2, 2))
    for _ in range(30):
        state = springs.step(state, np.array([[0.0, 2.0]]))
    assert state[0, 1, 0] > 0


def test_a_walker_crosses_a_gap_in_sumos_positions_smoothly():
    position, velocity, heading = np.zeros((1, 2)), np.array([[1.3, 0.0]]), np.zeros(1)
    steps, turns = [], []
    for k in range(80):
        target = np.array([[0.13 * k, 0.0 if k < 40 else 0.75]])
        moved, velocity, turned = walk(position, velocity, heading, target, np.zeros(1), STEP_S)
        steps.append(np.hypot(*(moved - position)[0]))
        turns.append(np.degrees(abs(turned - heading)[0]))
        position, heading = moved, turned
    assert max(steps) < 0.3 and max(turns) < 20
    assert position[0, 1] == pytest.approx(0.75, abs=0.02)


def test_who_has_turned_round_backs_up_along_the_way_since_and_not_through_the_turn():
    motion, headings, fronts = Motion(STEP_S), [], []

    def go_on(x: float, y: float, heading: float, speed: float) -> None:
        one = road_users(["car"], [[x, y, 0.0]], sizes=CAR, heading_rad=heading, speed_mps=speed)
        after = motion.update(one)
        headings.append(after.heading_rad[0])
        fronts.append(after.front[0, :2])

    for x in np.arange(-12.0, 0.0, 0.5):
        go_on(float(x), 0.0, 0.0, 5.0)
    motion.play("a0", plan_turn(fronts[-1], 0.0, "car", CAR, Room(-3.5, 12.0, 9.0, np.zeros((0, 5))), STEP_S))
    while motion.plays("a0"):
        go_on(-0.5, 0.0, 0.0, 0.0)
    end = fronts[-1]
    for gone in np.arange(0.0, 2.0, 0.2):
        go_on(float(end[0] - gone), float(end[1]), np.pi, 2.0)
    begin = len(fronts)
    assert motion.back_up("a0", 4.0, 1.0, 0.0)
    while motion.plays("a0"):
        go_on(float(fronts[begin - 1][0]), float(fronts[begin - 1][1]), np.pi, 0.0)
    turned = np.degrees(np.diff(np.unwrap(headings)))
    assert np.abs(turned).max() < 6
    assert np.hypot(*(np.array(fronts[begin:]) - end).T).max() < 2.5
    paces = np.hypot(*np.diff(np.array(fronts[begin:-1]), axis=0).T)
    assert np.abs(np.diff(paces)).max() / STEP_S**2 < 3

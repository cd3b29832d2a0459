"""Boxes as annotators draw them: the distribution of each edge, and which faces move."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sensors.effects.labels.box_shrink import BoxShrink
from sensors.effects.labels.few_points import FewPoints
from sensors.errors import SensorError
from sensors.label_boxes import LabelBoxes
from sensors.sensor_model import load_sensor
from tests.sensors.effects.scenes import sensor

SIZE = np.array([4.0, 1.8, 1.5])
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


def labelled(points, *, yaw=0.0, centre=(15.0, 3.0, -0.8), kind="Car"):
    """One box and points given along its own axes from its centre."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return LabelBoxes(
        kinds=(kind,),
        centre=np.array([centre]),
        size=SIZE[None],
        yaw=np.array([yaw]),
        kept=np.ones(1, bool),
        points=(np.asarray(points) @ turn.T + centre).astype(np.float32),
    )


def paper(**changes):
    return BoxShrink(**({"a_m": (0.2, 0.05, 0.05), "b": (0.25, 0.25, 0.05), "lift_m": 0.0} | changes))


def apply(effect, boxes):
    return sensor(effect).relabel(boxes)


inside = st.floats(0.05, 0.95)


@settings(max_examples=40, deadline=None)
@given(extent=st.tuples(inside, inside, inside), yaw=st.floats(-3.1, 3.1))
def test_each_edge_loses_a_plus_b_times_what_the_points_leave_free(extent, yaw):
    reach = SIZE * extent
    after = apply(paper(), labelled(CORNERS * reach / 2, yaw=yaw))
    expected = SIZE - (np.array([0.2, 0.05, 0.05]) + np.array([0.25, 0.25, 0.05]) * (SIZE - reach))
    np.testing.assert_allclose(after.size[0], expected, atol=1e-4)


@settings(max_examples=20, deadline=None)
@given(yaw=st.floats(-3.1, 3.1))
def test_a_face_with_points_on_it_stays_and_the_opposite_one_comes_nearer(yaw):
    rear = np.array([[-2.0 + 1e-4, y, z] for y in (-0.8, 0.8) for z in (-0.7, 0.7)])
    rear = np.vstack([rear, [[-1.0, 0, 0]]])
    before = labelled(rear, yaw=yaw)
    after = apply(paper(), before)
    along = np.array([np.cos(yaw), np.sin(yaw), 0])
    move = (after.centre[0] - before.centre[0]) @ along
    assert move - after.size[0, 0] / 2 == pytest.approx(-SIZE[0] / 2, abs=2e-3)
    assert move + after.size[0, 0] / 2 == pytest.approx(SIZE[0] / 2 - 0.2 - 0.25 * 3.0, abs=2e-3)


def test_the_box_is_lifted_so_that_the_road_s_points_count_no_more():
    road = np.array([[x, y, -0.74] for x in (-1.9, 1.9) for y in (-0.85, 0.85)])
    body = CORNERS * [1.0, 0.5, 0.6]
    lifted = apply(paper(lift_m=0.04), labelled(np.vstack([road, body])))
    flat = apply(paper(), labelled(np.vstack([road, body])))
    assert lifted.size[0, 0] == pytest.approx(4.0 - 0.2 - 0.25 * 2.0, abs=1e-4)
    assert flat.size[0, 0] == pytest.approx(4.0 - 0.2 - 0.25 * 0.2, abs=1e-4)
    alone = apply(paper(a_m=0.0, b=0.0, lift_m=0.04), labelled(body))
    assert alone.centre[0, 2] == pytest.approx(-0.8 + 0.04)


def test_boxes_without_points_and_people_keep_their_size():
    np.testing.assert_array_equal(apply(paper(), labelled([[50.0, 0, 0]])).size[0], SIZE)
    np.testing.assert_array_equal(apply(paper(), labelled(CORNERS * 0.3, kind="Pedestrian")).size[0], SIZE)


def test_no_edge_vanishes_however_strong_the_bias():
    assert apply(paper(a_m=2.0, b=1.0), labelled([[0.0, 0, 0]])).size.min() >= 0.1 - 1e-12


@pytest.mark.parametrize(("least", "kept"), [(0, True), (8, True), (9, False)])
def test_a_box_with_too_few_points_is_not_kept(least, kept):
    assert apply(FewPoints(points=least), labelled(CORNERS * 0.3)).kept.tolist() == [kept]


PLUGIN = '''
from dataclasses import replace
from typing import ClassVar

from sensors.effects import LabelEffect, number


class Wider(LabelEffect):
    """Boxes drawn too wide."""

    name: ClassVar = "wider"
    by_m: float = number("how much", unit="m", ge=0, le=1)

    def apply(self, boxes, rng):
        return replace(boxes, size=boxes.size + [0, self.by_m, 0])
'''


def test_a_user_s_own_label_effect_acts_by_its_file(tmp_path):
    (tmp_path / "wider.py").write_text(PLUGIN)
    (tmp_path / "s.yaml").write_text("pattern: hdl64e\neffects: [{effect: ./wider.py:Wider, by_m: 0.5}]\n")
    after = load_sensor(tmp_path / "s.yaml").relabel(labelled(CORNERS * 0.3))
    np.testing.assert_allclose(after.size[0] - SIZE, [0, 0.5, 0])


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        ("raise KeyError('no pen')", "no pen"),
        ("return None", "returned NoneType"),
        ("return replace(boxes, size=boxes.size * float('nan'))", "not finite"),
        ("return replace(boxes, size=boxes.size - 10)", "above zero"),
    ],
)
def test_a_broken_one_is_named_in_one_line(tmp_path, body, complaint):
    (tmp_path / "bad.py").write_text(PLUGIN.replace("return replace(boxes, size=boxes.size + [0, self.by_m, 0])", body))
    (tmp_path / "s.yaml").write_text("pattern: hdl64e\neffects: [{effect: ./bad.py:Wider, by_m: 0.5}]\n")
    with pytest.raises(SensorError, match=complaint) as caught:
        load_sensor(tmp_path / "s.yaml").relabel(labelled(CORNERS * 0.3))
    assert "\n" not in str(caught.value) and "wider" in str(caught.value)

"""Surroundings drawn from distributions."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from assets.world.build import build_world
from assets.world.buildings.plots import lay_out
from assets.world.environment import PROP_KINDS, Environment, EnvironmentConfig, PropDensities
from assets.world.furniture.furnishing import _PROPS, furnish
from assets.world.obstacles import Obstacles
from assets.world.roads.kerbside import kerbside
from assets.world.roads.surfaces import outline
from assets.world.styles import STYLES, style_of

from .small_town import small_town

_NONE = dict.fromkeys(PROP_KINDS, 0.0)


def _wide_pavements(style="urban"):
    """The small town with pavements of four metres."""
    town = small_town(style)
    lanes = []
    for lane in town.lanes:
        if lane.use == "sidewalk":
            across = lane.centre[:, :2] * np.where(np.abs(lane.centre[:, :2]).max(0) < 10, 5.2 / 4.2, 1.0)
            lane = replace(lane, width_m=4.0, centre=np.column_stack([across, lane.centre[:, 2]]))
        lanes.append(lane)
    return replace(town, lanes=tuple(lanes), parking=())


def _furnished(environment, seed=0, style="urban"):
    streets = _wide_pavements(style)
    outlines = outline(streets)
    blocked = Obstacles(streets, outlines, outlines.paved, [], shapely.Polygon())
    flat = lambda xy: np.zeros(len(xy))  # noqa: E731
    rng = np.random.default_rng(seed)
    mesh, _ = furnish(kerbside(streets, outlines), blocked, flat, style_of(style), environment, rng)
    return mesh, outlines


def test_every_kind_has_a_template_and_a_density():
    assert set(_PROPS) | {"utility_pole"} == set(PROP_KINDS)  # utility poles belong to overhead lines


def test_a_town_without_props_has_none():
    mesh, _ = _furnished(Environment(props_per_100m=_NONE))
    assert len(mesh.faces) == 0


@pytest.mark.parametrize("kind", sorted(set(PROP_KINDS) - {"bus_stop"}))
def test_each_kind_stands_on_the_pavement_and_off_the_road(kind):
    mesh, outlines = _furnished(Environment(props_per_100m={**_NONE, kind: 6.0}))
    assert len(mesh.faces) > 0
    low = mesh.vertices[mesh.vertices[:, 2] < 2.2]
    on_road = shapely.contains_xy(shapely.buffer(outlines.carriageway, -0.02), low[:, 0], low[:, 1])
    assert not on_road.any()


def test_more_props_are_requested_more_are_placed():
    counts = [len(_furnished(Environment(props_per_100m={**_NONE, "hydrant": d}))[0].faces) for d in (1.0, 4.0)]
    assert counts[1] > 2 * counts[0]


def test_fewer_houses_where_the_density_is_lower():
    outlines = outline(small_town("suburb"))
    plots = [
        np.mean(
            [
                len(lay_out(outlines.paved, Environment(building_density=d).dress(style_of("suburb")), _rng(seed)))
                for seed in range(6)
            ]
        )
        for d in (0.5, 1.0)
    ]
    assert plots[0] < plots[1]


def _rng(seed):
    return np.random.default_rng(seed)


@pytest.mark.parametrize("style", sorted(STYLES))
def test_the_usual_environment_leaves_a_style_as_it_is(style):
    assert Environment().dress(style_of(style)) == style_of(style)


def test_an_environment_changes_the_world_but_not_its_ground():
    streets = small_town()
    usual = build_world(streets, seed=5)
    other = build_world(streets, seed=5, environment=EnvironmentConfig().draw(_rng(1)))
    assert usual.ground.vertices.tobytes() == other.ground.vertices.tobytes()
    assert usual.mesh.vertices.tobytes() != other.mesh.vertices.tobytes()


@given(seed=st.integers(0, 2**32 - 1))
def test_draws_stay_within_their_ranges_and_repeat(seed):
    config = EnvironmentConfig(props_per_100m=PropDensities(bench=(1, 2)), vegetation=(0.5, 0.6), setback=1.0)
    drawn = config.draw(_rng(seed))
    assert drawn == config.draw(_rng(seed))
    assert 1 <= drawn.density("bench", 99.0) <= 2
    assert 0.5 <= drawn.vegetation <= 0.6
    assert drawn.setback == 1.0
    low, high = config.prop_factor
    assert 10 * low <= drawn.density("table", 10.0) <= 10 * high


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"vegetation": (2, 1)}, "minimum 2 is above maximum 1; write \\[1, 2\\]"),
        ({"setback": (-0.1, 1)}, "minimum -0.1 is negative"),
        ({"props_per_100m": {"bench": (3, 1)}}, "minimum 3 is above maximum 1"),
        ({"props_per_100m": {"statue": 1}}, "statue"),
        ({"building_density": (0, float("nan"))}, "is not finite"),
        ({"trees": 1}, "trees"),
    ],
)
def test_impossible_ranges_are_refused(values, says):
    with pytest.raises(ValidationError, match=says):
        EnvironmentConfig.model_validate(values)

"""Unknown effects: simple formulas for shapes, and plug-ins that act where the physics has them act."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.groups.dependences import covariates
from cosim.discrepancy.select import reshaped
from cosim.discrepancy.state import Found, Model, State, View
from cosim.discrepancy.unknown.plug_in import class_name, effect_source, shape_effect
from cosim.discrepancy.unknown.shape import Shape, best_formula
from sensors.effects.lasers import as_known, for_rings, with_rings
from sensors.effects.points.range_noise import RangeNoise
from sensors.effects.registry import find_effect
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import make_yard, viewed_yard

AZIMUTH = np.linspace(-np.pi, np.pi, 41)[:-1] + np.pi / 40


def shape(channel, y: np.ndarray, **more) -> Shape:
    sigma = np.full(len(AZIMUTH), 0.002)
    formula = best_formula(AZIMUTH, y, sigma, 2 * np.pi)
    return Shape(channel, "azimuth", "rad", AZIMUTH, y, sigma, formula, **more)


@pytest.mark.parametrize("centre", [-0.8, 3.0])
def test_a_spot_of_dirt_is_a_bell_wherever_it_is(centre: float) -> None:
    apart = np.mod(AZIMUTH - centre + np.pi, 2 * np.pi) - np.pi
    found = best_formula(AZIMUTH, -0.5 * np.exp(-((apart / 0.4) ** 2)), np.full(40, 0.002), 2 * np.pi)
    assert found.family == "bell"
    assert set(found.parameters) == {"amplitude", "centre", "width"}, "it needs no level"
    assert found.parameters["amplitude"] == pytest.approx(-0.5, rel=0.05)
    assert abs(np.mod(found.parameters["centre"] - centre + np.pi, 2 * np.pi) - np.pi) < 0.08
    assert found.parameters["width"] == pytest.approx(0.4, rel=0.1)


def test_a_formula_reads_as_people_write() -> None:
    text = best_formula(AZIMUTH, -0.3 * np.sin(2 * AZIMUTH + 0.5) - 0.1, np.full(40, 0.002), 2 * np.pi).text
    assert "-" not in text
    assert "− −" not in text
    assert "+ −" not in text


def test_a_warming_sensor_starts_from_nothing_and_keeps_its_level() -> None:
    time_s = np.linspace(0, 20, 40)
    y = 0.08 * (1 - np.exp(-time_s / 6))
    found = Shape("range", "frame_time", "s", time_s, y, np.full(40, 0.002), None)
    formula = best_formula(time_s, y, found.sigma)
    assert formula.r2 > 0.98
    assert formula.family == "exponential"


@pytest.mark.parametrize("channel", ["range", "intensity", "drop"])
def test_every_plug_in_loads_and_switches_off(channel, tmp_path: Path) -> None:
    found = shape(channel, -0.1 * (AZIMUTH > 0.6))
    file = tmp_path / "mine.py"
    file.write_text(effect_source(found), encoding="utf-8")
    kind = find_effect(f"mine.py:{class_name(found)}", tmp_path)
    assert kind.neutral is not None
    kind.model_validate(kind.neutral)
    kind.model_validate(kind.example)


@pytest.mark.parametrize("rings", [16, 64, 128])
def test_one_number_a_laser_whatever_their_number(rings: int) -> None:
    known = find_effect("ring_gain")
    kind = for_rings(known, rings)
    effect = kind.model_validate(kind.example)
    assert len(effect.model_dump()["gains"]) == rings
    assert type(as_known([effect])[0]) is known
    assert with_rings(as_known([effect]), rings)[0].model_dump() == effect.model_dump()


def test_a_shape_may_be_as_narrow_as_its_covariate() -> None:
    x, y = AZIMUTH * 1e-6, np.exp(-((AZIMUTH / 0.4) ** 2))
    sigma = np.full(len(x), 0.002)
    made = shape_effect(Shape("drop", "range", "m", x, -y, sigma, best_formula(x, -y, sigma)))
    assert getattr(made, "width") == pytest.approx(0.4e-6, rel=0.1)  # noqa: B009  its type is made at run time


def test_who_drives_straight_on_does_not_turn(tmp_path: Path) -> None:
    found = viewed_yard(make_yard(tmp_path, frames=6))
    for rates, there in ((np.linspace(0, 5e-5, 6), False), (np.linspace(0, 0.05, 6), True)):
        sample = found.fitter.sample
        sample = replace(sample, scan_values=sample.scan_values | {"yaw_rate_radps": rates})
        assert ("yaw_rate" in {one.name for one in covariates(sample, found.fitted.prediction, 10)}) is there


def test_an_oscillation_between_regular_scans_says_which_others_look_the_same() -> None:
    time_s = np.arange(24) * 0.5
    y = 0.03 * np.sin(2 * np.pi / 3.2 * time_s)
    sigma = np.full(24, 0.002)
    formula = best_formula(time_s, y, sigma)
    shape = Shape("range", "frame_time", "s", time_s, y, sigma, formula).with_aliases()
    assert formula.family == "sine"
    np.testing.assert_allclose(shape.aliases, [1 / (2 - 1 / 3.2), 1 / (2 + 1 / 3.2)], rtol=0.03)
    for period_s in shape.aliases:
        wave = 2 * np.pi / period_s
        parts = np.stack([np.sin(wave * time_s), np.cos(wave * time_s)], 1)
        left = y - parts @ np.linalg.lstsq(parts, y, rcond=None)[0]
        assert np.std(left) < 0.2 * np.std(y)
    assert "a period of" in shape.text


def found_in(view: View, one: Shape) -> tuple[State, Found]:
    """Where a diagnosis stands that added a shape, which is the first effect of a view."""
    found = Found(view.fitted.effects[0].name, 0.001, shape=one)
    return State(Model(view.fitted.effects, (0,)), view, view, (found,)), found


def test_a_shape_is_drawn_anew_as_it_is_beside_all_else(tmp_path: Path) -> None:
    bell = 0.06 * np.exp(-(((AZIMUTH - 0.5) / 0.5) ** 2))
    effects = (shape_effect(shape("range", bell)), RangeNoise(sigma_m=0.01))
    yard = make_yard(tmp_path, effects, known=(NOISE,), frames=4)
    first = shape("range", bell + 0.02 * np.sin(AZIMUTH))
    known = viewed_yard(yard).fitted.effects
    state, found = found_in(viewed_yard(yard, (shape_effect(first), *known), (0,)), first)
    now, better = reshaped(state, found) or (None, None)
    assert now is not None
    assert np.sqrt(np.mean((now.y - np.interp(now.x, AZIMUTH, bell)) ** 2)) < 0.006
    fitted = state.view.fitted.effects[0] if better is None else better.fitted.effects[better.place]
    assert now.refitted(fitted.model_dump(), {}).r2 > 0.9


def test_a_shape_that_is_no_longer_there_is_gone(tmp_path: Path) -> None:
    yard = make_yard(tmp_path, (RangeNoise(sigma_m=0.01),), known=(NOISE,), frames=4)
    first, view = shape("range", 0.05 * np.sin(3 * AZIMUTH)), viewed_yard(yard)
    effects = (shape_effect(first), *view.fitted.effects)
    view = replace(view, fitted=view.fitter.at(effects, view.fitted.estimate))
    state, found = found_in(view, first)
    assert reshaped(state, found) == (None, None)

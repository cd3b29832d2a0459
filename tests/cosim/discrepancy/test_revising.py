"""What was added stays only as long as it does something."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from assets.materials import MATERIALS
from cosim.discrepancy.revising import is_idle, with_its_curve
from cosim.discrepancy.settling import Settled
from cosim.discrepancy.unknown import Shape, shape_effect
from cosim.discrepancy.unknown.formulas import Formula
from sensors.effects.base import Effect
from sensors.effects.range_bias import RangeBias
from sensors.effects.range_noise import RangeNoise
from sensors.effects.range_quantization import RangeQuantization
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import Yard, make_yard, settled

NOISY = RangeNoise(sigma_m=0.01)


def _with_a_bias(yard: Yard) -> Settled:
    """The yard with a bias of ranges fitted, whether it has one or not."""
    return settled(yard, (RangeBias(offset_m=0.0), NOISY), free=[0])


def test_what_was_there_is_not_idle(biased_yard: Yard) -> None:
    found = _with_a_bias(biased_yard)
    assert not is_idle(found.fitter, found.fitted, 0, clearly=5.0)


@pytest.mark.parametrize("seed", range(3))
def test_what_may_as_well_be_nothing_is_idle(tmp_path: Path, seed: int) -> None:
    found = _with_a_bias(make_yard(tmp_path, (NOISY,), known=(NOISE,), frames=8, seed=seed))
    assert abs(found.fitted.effects[0].offset_m) < 0.002  # pyright: ignore[reportAttributeAccessIssue]
    assert is_idle(found.fitter, found.fitted, 0, clearly=5.0)


def test_so_is_what_was_said_before(biased_yard: Yard) -> None:
    found = _with_a_bias(biased_yard)
    assert is_idle(found.fitter, found.fitted, 0, clearly=5.0, said=found.fitted.effects[0])
    assert not is_idle(found.fitter, found.fitted, 0, clearly=5.0, said=RangeBias(offset_m=0.03))


def _bell_about(centre: float) -> Effect:
    """Surfaces of one albedo are 4 cm too far."""
    code = "amplitude * np.exp(-(((x - centre) / width) ** 2))"
    bell = Formula("bell", "bell", code, {"amplitude": 0.04, "centre": centre, "width": 0.02}, 1.0, 0.0)
    x = np.linspace(0.1, 0.6, 10)
    return shape_effect(Shape("range", "albedo", "", x, 0 * x, 0 * x + 0.01, bell, 1.0, ()))


def test_what_is_not_sure_of_its_place_may_be_there_all_the_same(tmp_path: Path) -> None:
    """Of one albedo that is off, a bell's height, middle and width are one number, which three can make up."""
    grass = MATERIALS["grass"].reflectance
    yard = make_yard(tmp_path, (_bell_about(grass), NOISY), known=(NOISE,), frames=8)
    found = settled(yard, (_bell_about(grass + 0.01), NOISY), free=[0, 1])
    place = next(row for row, one in enumerate(found.fitted.effects) if one.name.startswith("unknown"))
    assert not is_idle(found.fitter, found.fitted, place, clearly=5.0)


def test_a_rounding_is_a_fact_of_the_file(biased_yard: Yard) -> None:
    found = settled(biased_yard, (RangeQuantization(step_m=0.002), NOISY))
    place = next(row for row, one in enumerate(found.fitted.effects) if one.name == "range_quantization")
    assert not is_idle(found.fitter, found.fitted, place, clearly=5.0)


def test_a_curve_is_that_beside_the_model_as_it_stands(tmp_path: Path) -> None:
    """One that was drawn beside a bias that is gone stands aside by it, and its formula would explain nothing."""
    x = np.linspace(-np.pi, np.pi, 41)[:-1] + np.pi / 40
    step = Formula("step", "[x > {edge:.3g}]", "amplitude * (x > edge)", {"amplitude": 0.05, "edge": 0.6}, 1.0, 0.0)
    stale = Shape("range", "azimuth", "rad", x, 0.05 * (x > 0.6) - 0.04, 0 * x + 0.001, step, 100.0, ())
    yard = make_yard(tmp_path, (shape_effect(stale), NOISY), known=(NOISE,), frames=8)
    found = settled(yard, (shape_effect(stale), NOISY))
    place = next(row for row, one in enumerate(found.fitted.effects) if one.name.startswith("unknown"))
    values = found.fitted.effects[place].model_dump()
    drawn = with_its_curve(found.fitter, found.fitted, place, stale)
    assert np.median(np.abs(drawn.y - 0.05 * (drawn.x > 0.6))) < 0.005
    assert stale.refitted(values, {}).r2 < 0
    assert drawn.refitted(values, {}).r2 > 0.9

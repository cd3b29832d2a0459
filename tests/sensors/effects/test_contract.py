"""What holds for every effect of the catalogue: sources, bounds, mutual confusions, random numbers, derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from cosim.discrepancy.candidates import unknowns, with_values
from sensors.effects.acting import in_order
from sensors.effects.base import Effect, ScanEffect
from sensors.effects.expectation import expect
from sensors.effects.lasers import with_rings
from sensors.effects.registry import built_in_effects
from tests.sensors.effects.alone import EGO, boxes
from tests.sensors.effects.scenes import cars, effect, of_hits, sensor, shoot, street

EFFECTS = built_in_effects()
# Functions with jumps (rounding, limits, silhouettes, textures that parameters shift) are fitted by line search.
JUMPS = (
    "intensity_floor", "intensity_quantization", "max_range", "own_shadow", "own_silhouette", "range_quantization",
    "reflectance_field", "surface_grain", "surface_relief", "weak_signal",
)  # fmt: skip
SMOOTH = [
    name
    for name, kind in EFFECTS.items()
    if kind.stage not in ("beam", "label")
    and not issubclass(kind, ScanEffect)
    and not kind.by_search
    and not kind.needs_new_rays
    and name not in JUMPS
]


@pytest.mark.parametrize("name", EFFECTS)
def test_it_states_its_equation_and_the_source_of_the_equation(name: str) -> None:
    kind = EFFECTS[name]
    assert kind.equation and kind.reference
    assert (kind.__doc__ or "").strip()
    assert kind.name == name
    assert set(kind.example) <= set(kind.model_fields)
    for parameter in kind.parameters():
        assert parameter.description


@pytest.mark.parametrize("name", EFFECTS)
def test_values_beyond_the_bounds_are_refused(name: str) -> None:
    kind = EFFECTS[name]
    for parameter in kind.parameters():
        for bound, beyond in ((parameter.low, -1.0), (parameter.high, 1.0)):
            if bound is None or parameter.choices or not np.isfinite(bound):
                continue
            value = bound + beyond * max(abs(bound), 1.0) * 1e-3
            like = getattr(effect(name), parameter.name)
            with pytest.raises(ValidationError):
                kind.model_validate(
                    {**kind.example, parameter.name: [value] * len(like) if parameter.per_ring else value}
                )


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_that_it_can_be_mistaken_for_can_be_mistaken_for_it(name: str) -> None:
    for other in EFFECTS[name].confusable_with:
        assert other in EFFECTS and other != name
        assert name in EFFECTS[other].confusable_with


@pytest.mark.parametrize("name", EFFECTS)
def test_equal_seeds_give_equal_returns(name: str) -> None:
    first, shot = shoot(sensor(effect(name)), street(), placed=cars(), ego=EGO, seed=5)
    again, other = shoot(sensor(effect(name)), street(), placed=cars(), ego=EGO, seed=5)
    for column in ("beam", "range_m", "intensity", "return_no"):
        np.testing.assert_array_equal(getattr(first, column), getattr(again, column))
    if EFFECTS[name].stage == "label":
        model = sensor(effect(name))
        np.testing.assert_array_equal(model.relabel(boxes(first, shot)).size, model.relabel(boxes(again, other)).size)


@pytest.mark.parametrize("name", SMOOTH)
def test_derivatives_by_finite_differences_do_not_depend_on_the_step(name: str) -> None:
    _, shot = of_hits(sensor(), street(), placed=cars())
    (whole,) = with_rings(in_order((effect(name),)), 64)
    for unknown in unknowns(type(whole)):
        slopes = [_slope(whole, unknown.name, unknown.step * share, shot) for share in (1.0, 0.5)]
        size = max(np.linalg.norm(slope) for slope in slopes)
        assert np.isfinite(size)
        assert np.linalg.norm(slopes[0] - slopes[1]) <= 0.05 * size


def _slope(whole: Effect, name: str, step: float, shot) -> np.ndarray:
    """Derivative of mean range, intensity and probability of a return of all beams, by a central difference."""
    value, expected = np.asarray(getattr(whole, name), float), []
    for by in (step, -step):
        of = expect((with_values(whole, {name: value + by}),), shot)
        expected.append(np.concatenate([np.nan_to_num(of.range_m), of.intensity, of.seen, of.intensity_sigma]))
    return (expected[0] - expected[1]) / (2 * step)


@pytest.mark.parametrize("name", EFFECTS)
def test_steps_of_finite_differences_are_small_against_the_example(name: str) -> None:
    """Also where the effect is neutral at a limit far away."""
    kind = EFFECTS[name]
    if kind.neutral is None:
        return
    for unknown in unknowns(kind):
        if unknown.name in kind.example and np.any(kind.example[unknown.name]):
            assert 0 < unknown.step <= 0.1 * np.max(np.abs(kind.example[unknown.name]))

"""Effects of unknown dependences: the contract over all channels and kinds of covariates."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.unknown.curve import Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import effect_class, effect_of
from cosim.discrepancy.unknown.source import effect_source
from sensors.effects.base import Effect
from sensors.effects.registry import find_effect
from sensors.effects.shared_errors import UNITS
from sensors.hits import NOTHING
from sensors.returns import Returns
from sensors.sensor_model import SensorModel
from tests.cosim.discrepancy.unknown_curves import (
    COVARIATES,
    EGO,
    PAIRS,
    PATTERN,
    SHARED,
    SIZES,
    curve_of,
    expected,
    log_likelihood,
    measured,
    object_curve,
    shared_curve,
    traced,
)
from tests.sensors.effects.scenes import LIDAR, cars, street

_ALL = [
    *(curve_of(channel, name) for channel in SIZES for name in COVARIATES),
    *(curve_of(channel, *pair) for channel in SIZES for pair in PAIRS),
]
OF_UNITS = [shared_curve(channel, unit) for channel in SHARED for unit in UNITS]
OF_OBJECTS = [object_curve("object_size"), object_curve("object_place")]
FEW = [*_ALL[:: len(SIZES) - 2], *OF_UNITS[::3], *OF_OBJECTS]
ONE_EACH = [
    *(curve_of(channel, "azimuth") for channel in SIZES),
    *(curve_of(channel, "range") for channel in SIZES),
    *(shared_curve(channel, "firing") for channel in SHARED),
    *OF_OBJECTS,
]


def named(curve: Curve) -> str:
    return curve.name


def from_file(curve: Curve, folder: Path) -> Effect:
    """The effect of the written file."""
    unknown = UnknownEffect.of(curve)
    (folder / f"{unknown.name}.py").write_text(effect_source(unknown), encoding="utf-8")
    kind = find_effect(f"{unknown.name}.py:{unknown.class_name}", folder)
    return kind.model_validate(kind.example)


def is_same(first: Returns, second: Returns) -> bool:
    return all(getattr(first, one.name).tobytes() == getattr(second, one.name).tobytes() for one in fields(Returns))


@cache
def unchanged() -> Returns:
    return measured((), traced())


def check_file_against_class(curve: Curve, folder: Path) -> None:
    written, made = from_file(curve, folder), effect_of(curve)
    assert written.model_dump() == made.model_dump()
    for name in ("name", "channel", "stage", "phase", "example", "neutral", "shapes", "equation", "needs_new_rays"):
        assert getattr(written, name) == getattr(made, name)
    shots = traced((written,)), traced((made,))
    assert is_same(measured((written,), shots[0]), measured((made,), shots[1]))
    first, second = expected((written,), shots[0]), expected((made,), shots[1])
    for one in ("range_m", "range_sigma_m", "intensity", "intensity_sigma", "seen", "silent", "elsewhere"):
        np.testing.assert_array_equal(getattr(first, one), getattr(second, one))


@pytest.mark.parametrize("curve", FEW, ids=named)
def test_the_written_file_and_the_class_in_memory_do_the_same(curve: Curve, tmp_path: Path) -> None:
    check_file_against_class(curve, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("curve", [*_ALL, *OF_UNITS], ids=named)
def test_every_written_file_and_class_do_the_same(curve: Curve, tmp_path: Path) -> None:
    check_file_against_class(curve, tmp_path)


@pytest.mark.parametrize("curve", FEW, ids=named)
def test_files_are_short_and_give_units(curve: Curve) -> None:
    source = effect_source(curve)
    lines = source.splitlines()
    assert len(lines) <= 60
    assert max(map(len, lines)) <= 120
    assert not curve.unit or f"[{curve.unit}]" in source
    assert all(f"[{unit}]" in source for unit in curve.units if unit)
    assert "eval(" not in source and "exec(" not in source


@pytest.mark.parametrize("curve", [*_ALL[:: len(SIZES) + 2], *OF_UNITS[::4], *OF_OBJECTS], ids=named)
def test_neutral_parameters_do_nothing(curve: Curve) -> None:
    kind = effect_class(curve)
    effect = kind.model_validate(kind.neutral)
    assert is_same(measured((effect,), traced((effect,))), unchanged())


@pytest.mark.parametrize("curve", ONE_EACH, ids=named)
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(curve: Curve) -> None:
    effect = effect_of(curve)
    shot = traced((effect,))
    first = measured((effect,), shot, 1)
    assert is_same(first, measured((effect,), shot, 1))
    assert not is_same(first, measured((effect,), shot, 2))
    assert not is_same(first, measured((), traced(), 1))


@pytest.mark.parametrize("curve", ONE_EACH, ids=named)
def test_the_likelihood_of_simulated_scans_is_highest_at_their_own_amplitude(curve: Curve) -> None:
    kind = effect_class(curve)
    amplitude = "sigma" if curve.is_shared else "amplitude"

    def scaled(factor: float) -> Effect:
        values = {
            name: factor * value if name in (amplitude, "level") else value for name, value in kind.example.items()
        }
        return kind.model_validate(values)

    shot = traced((scaled(1.0),))
    scans = [measured((scaled(1.0),), shot, seed) for seed in range(6)]
    factors = np.array([0.7, 1.0, 1.3])
    found = [log_likelihood((scaled(factor),), traced((scaled(factor),)), scans) for factor in factors]
    curvature, slope, _ = np.polyfit(factors, found, 2)
    assert curvature < 0
    assert -slope / (2 * curvature) == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("channel", ["spurious", "early", "late"])
def test_returns_from_elsewhere_have_the_density_that_is_predicted(channel: str) -> None:
    effect = effect_of(curve_of(channel, "azimuth"))
    shot = traced()
    drawn = [measured((effect,), shot, seed) for seed in range(12)]
    ranges = np.concatenate([scan.range_m[scan.instance == NOTHING] for scan in drawn])
    edges = np.array([0.0, 2, 5, 10, 20, 40, 80, 125])
    grid = (edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(200) + 0.5) / 200).ravel()
    beams = np.arange(len(shot.rays))
    density = [effect.density(beams, np.full(len(beams), at), shot).sum() for at in grid]
    predicted = np.reshape(density, (len(edges) - 1, 200)).mean(1) * np.diff(edges) * len(drawn)
    counted = np.histogram(ranges, edges)[0]
    assert np.all(np.abs(counted - predicted) < 4 * np.sqrt(predicted) + 0.02 * predicted + 1)


@pytest.mark.parametrize("channel", SHARED)
@pytest.mark.parametrize("unit", UNITS)
def test_the_beams_of_a_unit_share_one_error(channel: str, unit: str) -> None:
    effect, shot = effect_of(shared_curve(channel, unit)), traced()
    unit_of = effect.group(shot.solids, shot)  # type: ignore[attr-defined]
    z = effect.draw(shot.solids, shot, np.random.default_rng(3))  # type: ignore[attr-defined]
    for code in np.unique(unit_of)[:20]:
        assert len(np.unique(z[unit_of == code])) == 1
    assert len(np.unique(z)) == len(np.unique(unit_of))


def test_longer_and_wider_objects_are_met_where_their_surfaces_are_displaced() -> None:
    scene, placed, noiseless = street(), cars(), SensorModel(PATTERN, (), "test.yaml")
    larger = replace(placed, scales=placed.scales * np.array([1.05, 0.96, 1.02]))
    placed = replace(placed, sizes=np.tile([4.0, 1.7, 1.5], (2, 1)))
    curve = object_curve("object_size")
    curve = replace(curve, y=np.array([[0.05 * 4.0, -0.04 * 1.7, 0.02 * 1.5], [0.0, 0.0, 0.0]]))
    effect = effect_of(curve)
    truth, _ = noiseless.trace_returns(scene, LIDAR, larger, EGO)
    before, shot = noiseless.trace_returns(scene, LIDAR, placed, EGO)
    after = effect.apply(before, shot, np.random.default_rng(0))  # type: ignore[attr-defined]
    _, old, new = np.intersect1d(before.beam, truth.beam, return_indices=True)
    is_on = (before.instance[old] >= 0) & (truth.instance[new] == before.instance[old])
    is_on &= (before.normal_code[old] == truth.normal_code[new]).all(1)
    gap = truth.range_m[new][is_on] - after.range_m[old][is_on]
    assert is_on.sum() > 100
    assert np.median(np.abs(truth.range_m[new][is_on] - before.range_m[old][is_on])) > 0.02
    assert np.quantile(np.abs(gap), 0.9) < 0.005


@pytest.mark.parametrize(("neighbour", "step"), [("previous_lost", 1), ("above_lost", 360), ("below_lost", -360)])
def test_losses_come_in_bursts_where_they_depend_on_a_neighbour(neighbour: str, step: int) -> None:
    loss = {"seen": 0.05, "lost": 0.7}
    curve = Curve("drop", (neighbour,), ("",), (tuple(loss),), -np.array(list(loss.values())), np.full(2, 1e-3))
    effect, shot = effect_of(curve), traced()
    exists = shot.hits.solid.exists
    beams = np.arange(len(exists))
    has_both = exists & (beams >= step) & (beams < len(beams) + min(step, 0))
    has_both[has_both] &= exists[beams[has_both] - step]
    if step == 1:
        has_both &= beams % 360 > 0
    count, lost_count = {"seen": 0, "lost": 0}, {"seen": 0, "lost": 0}
    for seed in range(8):
        is_lost = exists.copy()
        is_lost[measured((effect,), shot, seed).beam] = False
        rows = np.flatnonzero(has_both)
        for name, is_after in (("seen", ~is_lost[rows - step]), ("lost", is_lost[rows - step])):
            count[name] += int(is_after.sum())
            lost_count[name] += int(is_lost[rows[is_after]].sum())
    for name, probability in loss.items():
        spread = np.sqrt(probability * (1 - probability) / count[name])
        assert lost_count[name] / count[name] == pytest.approx(probability, abs=4 * spread)

"""Formulas, tables and factors that describe measured curves."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from cosim.cli.main import main
from cosim.discrepancy.unknown.curve import Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import bounds, effect_of
from cosim.discrepancy.unknown.families import FAMILIES
from cosim.discrepancy.unknown.formula import best_formula
from cosim.discrepancy.unknown.pairs import singular_pair
from cosim.discrepancy.unknown.source import effect_source
from cosim.discrepancy.unknown.terms import Line, TermTable
from cosim.drives.sensor_files import write_sensor
from sensors.effects.covariates import Categories
from sensors.pattern import load_pattern
from sensors.sensor_model import SensorModel, load_sensor

AZIMUTH = np.linspace(-np.pi, np.pi, 41)[:-1] + np.pi / 40
RANGE_M = np.linspace(3, 60, 30)
TIME_S = np.linspace(0, 20, 40)
TURN = 2 * np.pi


def bell(x: np.ndarray, centre: float, width: float) -> np.ndarray:
    return np.exp(-(((np.mod(x - centre + np.pi, TURN) - np.pi) / width) ** 2))


@pytest.mark.parametrize(
    ("x", "y", "period", "family"),
    [
        (RANGE_M, 0.001 * RANGE_M, 0, "linear"),
        (RANGE_M, 0.02 * np.exp(-(RANGE_M - 3) / 15), 0, "decay"),
        (RANGE_M, 0.02 * np.exp((RANGE_M - 60) / 8), 0, "growth"),
        (RANGE_M, 0.01 + 0.001 * np.maximum(RANGE_M - 30, 0), 0, "hinge"),
        (RANGE_M, 0.01 + 0.001 * np.maximum(30 - RANGE_M, 0), 0, "hinge below"),
        (RANGE_M, 0.05 * ((RANGE_M > 20) & (RANGE_M < 35)), 0, "window"),
        (RANGE_M, 0.05 * (RANGE_M > 41), 0, "step"),
        (TIME_S, 0.08 * (1 - np.exp(-TIME_S / 6)), 0, "decay"),
        (TIME_S + 1.7e9, 0.08 * (1 - np.exp(-TIME_S / 6)), 0, "decay"),
        (TIME_S, 0.03 * np.sin(TURN / 3.2 * TIME_S), 0, "sine"),
        (AZIMUTH, -0.5 * bell(AZIMUTH, -0.8, 0.4), TURN, "cyclic bell"),
        (AZIMUTH, -0.5 * bell(AZIMUTH, 3.0, 0.4), TURN, "cyclic bell"),
        (AZIMUTH, -0.3 * np.sin(2 * AZIMUTH + 0.5) - 0.1, TURN, "harmonic"),
        (AZIMUTH, -0.3 * ((AZIMUTH > 2.5) | (AZIMUTH < -2)), TURN, "sector"),
    ],
)
def test_a_curve_gets_the_formula_that_made_it(x: np.ndarray, y: np.ndarray, period: float, family: str) -> None:
    noise = np.random.default_rng(0).normal(0, 5e-4, len(x))
    formula = best_formula(x, y + noise, np.full(len(x), 1e-3), period)
    assert formula.family == family
    assert formula.r2 > 0.98
    assert np.sqrt(np.mean((formula.evaluate(x) - y) ** 2)) < 0.03 * np.ptp(y)


def test_formulas_of_single_points_are_constants() -> None:
    assert best_formula(np.zeros(1), np.array([0.02]), np.array([1e-3])).text("x") == "0.02"


@pytest.mark.parametrize("variable", ["x", "y"])
def test_texts_name_functions_and_the_variable_correctly(variable: str) -> None:
    words = {"exp", "sin", "max", "ln", "frac", "from", "to", variable}
    for family in FAMILIES.values():
        values = dict.fromkeys(("amplitude", "level", *family.free, *family.fixed), 2.5)
        formula = best_formula(np.zeros(1), np.array([1.0]), np.array([1.0]))
        text = type(formula)(family.name, values, 1.0, 0.0).text(variable)
        assert set(re.findall(r"[a-z]+", text)) <= words
        assert family.name == "constant" or re.search(rf"\b{variable}\b", text)


def test_texts_have_proper_signs() -> None:
    text = best_formula(AZIMUTH, -0.3 * np.sin(2 * AZIMUTH + 0.5) - 0.1, np.full(40, 0.002), TURN).text("x")
    assert text == "−0.3·sin(2·x + 0.5) − 0.1"


def test_unknown_cells_do_not_count() -> None:
    y, sigma = 0.001 * RANGE_M, np.full(30, 1e-4)
    y[3], sigma[7], y[7] = np.nan, np.inf, 5.0
    unknown = UnknownEffect.of(Curve("range", ("range",), ("m",), (RANGE_M,), y, sigma))
    assert unknown.form == "0.001·x"


def test_a_shape_that_no_formula_fits_stays_the_curve() -> None:
    y = np.random.default_rng(4).normal(0, 0.05, 30)
    unknown = UnknownEffect.of(Curve("range", ("range",), ("m",), (RANGE_M,), y, np.full(30, 1e-4)))
    assert isinstance(unknown.terms[0], Line)
    np.testing.assert_allclose(unknown.predict(RANGE_M), y, atol=1e-5)


def test_a_pair_is_the_product_of_its_factors_with_their_units() -> None:
    first, second = -0.3 * bell(AZIMUTH, 0.5, 0.6), np.linspace(1, 0.2, 12)
    y = np.outer(first, second) + np.random.default_rng(1).normal(0, 0.003, (40, 12))
    elevation = np.linspace(-20, 2, 12)
    sigma = np.full(y.shape, 0.005)
    sigma[3, 4], y[3, 4] = np.inf, np.nan
    axes = AZIMUTH, elevation
    unknown = UnknownEffect.of(Curve("drop", ("azimuth", "elevation"), ("rad", "deg"), axes, y, sigma, (TURN, 0.0)))
    assert re.fullmatch(r"\(−0\.\d+·exp\(−\(\(x − 0\.\d+\)/0\.\d+\)²\)\)·\(.*y.*\)", unknown.form)
    assert "[rad]" in unknown.variables and "[deg]" in unknown.variables
    assert unknown.r2 > 0.97
    assert [factor.unit for factor in unknown.factors] == ["rad", "deg"]
    for factor in unknown.factors:
        np.testing.assert_allclose(factor.term.evaluate(factor.x), factor.y, atol=0.03)  # type: ignore[arg-type]
    parts = singular_pair(y, sigma)
    assert np.abs(parts[1]).max() == pytest.approx(1.0)
    np.testing.assert_allclose(np.outer(*parts), np.outer(first, second), atol=0.01)


def pair_that_is_no_product() -> Curve:
    """Losses behind two masks at different azimuths and elevations, by ring and azimuth."""
    names = tuple(str(ring) for ring in range(8))
    y = np.zeros((8, 40))
    y[:3, 4:9], y[4:, 22:30] = -0.9, -0.6
    y += np.random.default_rng(3).normal(0, 0.002, y.shape)
    sigma = np.full(y.shape, 0.004)
    sigma[7, 39], y[7, 39] = np.inf, np.nan
    return Curve("drop", ("ring", "azimuth"), ("", "rad"), (names, AZIMUTH), y, sigma, (0.0, TURN))


def test_a_pair_that_is_no_product_stays_a_table() -> None:
    curve = pair_that_is_no_product()
    unknown = UnknownEffect.of(curve)
    assert unknown.grid is not None and not unknown.terms
    assert unknown.form.startswith("table of 8 × 40 values, from −0.9") and "x = " in unknown.form
    rings = Categories(np.repeat(np.arange(8), 40), curve.x[0])  # type: ignore[arg-type]
    azimuth = np.tile(AZIMUTH, 8) + TURN  # cyclic
    made = effect_of(unknown)
    found = made.error(rings, azimuth).reshape(8, 40)  # type: ignore[attr-defined]
    np.testing.assert_allclose(found, np.where(curve.is_known, curve.y, 0.0), atol=1e-5)
    others = Categories(np.array([-1, 0]), ("99",))
    np.testing.assert_equal(made.error(others, np.zeros(2)), 0.0)  # type: ignore[attr-defined]


def test_the_plug_in_of_a_table_of_two_covariates_is_the_same_effect(tmp_path: Path) -> None:
    unknown = UnknownEffect.of(pair_that_is_no_product())
    sensor = SensorModel(load_pattern("hdl64e"), (effect_of(unknown),), "found")
    path = write_sensor(sensor, tmp_path / "sensor.yaml", {unknown.name: (unknown.class_name, effect_source(unknown))})
    loaded = load_sensor(path).effects[0]
    rings = Categories(np.arange(300) % 8, tuple(str(ring) for ring in range(8)))
    azimuth = np.random.default_rng(0).uniform(-np.pi, np.pi, 300)
    expected = effect_of(unknown).error(rings, azimuth)  # type: ignore[attr-defined]
    np.testing.assert_allclose(loaded.error(rings, azimuth), expected, atol=1e-6)  # type: ignore[attr-defined]
    halved = unknown.refitted({"amplitude": 0.5}, {"amplitude": [0.4, 0.6]})
    np.testing.assert_allclose(effect_of(halved).error(rings, azimuth), expected / 2, atol=1e-6)  # type: ignore[attr-defined]


def test_a_table_names_its_significant_categories() -> None:
    names, y = ("asphalt", "grass", "concrete"), np.array([0.05, 0.001, -0.02])
    unknown = UnknownEffect.of(Curve("range", ("material",), ("",), (names,), y, np.full(3, 0.004)))
    assert isinstance(unknown.terms[0], TermTable)
    assert unknown.form == "asphalt: +0.05, concrete: −0.02 and 1 more"
    assert [row[0] for row in unknown.table_rows()] == ["asphalt", "concrete"]


def test_an_oscillation_between_regular_scans_names_the_periods_that_look_the_same() -> None:
    time_s = np.arange(24) * 0.5
    y = 0.03 * np.sin(TURN / 3.2 * time_s)
    unknown = UnknownEffect.of(Curve("range", ("frame_time",), ("s",), (time_s,), y, np.full(24, 0.002)))
    np.testing.assert_allclose(sorted(unknown.aliases), [1 / (2 + 1 / 3.2), 1 / (2 - 1 / 3.2)], rtol=0.03)
    assert "a period of" in unknown.form
    for period_s in unknown.aliases:
        turn = TURN / period_s * time_s
        parts = np.stack([np.sin(turn), np.cos(turn)], 1)
        rest = y - parts @ np.linalg.lstsq(parts, y, rcond=None)[0]
        assert np.std(rest) < 0.2 * np.std(y)


def test_a_shape_may_be_as_narrow_as_its_covariate() -> None:
    x, y = AZIMUTH * 1e-6, np.exp(-((AZIMUTH / 0.4) ** 2))
    made = effect_of(Curve("drop", ("firing_time",), ("s",), (x,), -y, np.full(len(x), 0.002)))
    assert made.model_dump()["width"] == pytest.approx(0.4e-6, rel=0.1)


def test_json_has_the_keys_and_takes_over_a_later_fit() -> None:
    unknown = UnknownEffect.of(
        Curve("range", ("range",), ("m",), (RANGE_M,), 0.001 * RANGE_M, np.full(30, 1e-4), p_value=0.01)
    )
    fitted = unknown.refitted({"amplitude": 0.0011}, {"amplitude": [0.001, 0.0012]})
    found = fitted.to_json()
    assert found["form"] == "0.0011·x"
    assert found["r2"] < unknown.r2
    assert found["params"] == {"amplitude": 0.0011} and found["ci95"] == {"amplitude": [0.001, 0.0012]}
    assert set(found["curve"]) == {"x", "y", "sigma"}
    assert {"channel", "covariates", "form", "r2", "p_value", "unit"} <= set(found)
    assert effect_of(fitted).model_dump() == {"amplitude": 0.0011}


def test_a_sensor_file_with_unknown_effects_loads_from_where_it_is(tmp_path: Path) -> None:
    unknown = UnknownEffect.of(
        Curve("elevation_error", ("range",), ("m",), (RANGE_M,), 1e-4 * RANGE_M, np.full(30, 1e-5))
    )
    sensor = SensorModel(load_pattern("hdl64e"), (effect_of(unknown),), "found")
    own = {unknown.name: (unknown.class_name, effect_source(unknown))}
    path = write_sensor(sensor, tmp_path / "sub" / "sensor.yaml", own)
    loaded = load_sensor(path).effects[0]
    assert loaded.model_dump() == effect_of(unknown).model_dump()
    assert Path(loaded.source.rpartition(":")[0]).parent == path.parent


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"channel": "colour"}, "channel is 'colour'"),
        ({"covariates": ("moon_phase",)}, "'moon_phase' of range is unknown"),
        ({"y": np.zeros(3)}, "y has shape"),
        ({"units": ("m", "s")}, "different lengths"),
        ({"sigma": np.full(30, np.nan)}, "no value of y is known"),
        ({"channel": "shared_range"}, "choose one of firing, packet, sector, scan, block, ring"),
    ],
)
def test_curves_that_make_no_sense_are_refused(change: dict, complaint: str) -> None:
    values = {
        "channel": "range",
        "covariates": ("range",),
        "units": ("m",),
        "x": (RANGE_M,),
        "y": 0.001 * RANGE_M,
        "sigma": np.full(30, 1e-4),
    }
    with pytest.raises(ValueError, match=complaint):
        Curve(**{**values, **change})


def test_the_command_shows_an_unknown_effect(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    unknown = UnknownEffect.of(
        Curve("range", ("range",), ("m",), (RANGE_M,), 0.02 * np.exp(-(RANGE_M - 3) / 15), np.full(30, 1e-4))
    )
    (tmp_path / "found.py").write_text(effect_source(unknown), encoding="utf-8")
    assert main(["effects", f"{tmp_path}/found.py:{unknown.class_name}"]) == 0
    assert "length: length over which it falls to 1/e [at least 1e-06 m]" in capsys.readouterr().out


def test_a_settling_error_late_in_a_drive_is_a_decay_not_a_huge_power() -> None:
    time_s = np.linspace(63.1, 73.0, 12)
    noise = 0.002 * np.random.default_rng(4).normal(size=len(time_s))
    settling = 0.02 - 0.05 * np.exp(-(time_s - 63.1) / 3.4) + noise
    formula = best_formula(time_s, settling, np.full(len(time_s), 0.002))
    assert formula.family == "decay"
    assert formula.values["length"] == pytest.approx(3.4, rel=0.15)


def test_a_bend_is_no_small_part_of_a_long_wave() -> None:
    """A quadratic curve fits a sine of any long period, with amplitudes as large as one likes."""
    x = np.linspace(-25.0, 15.0, 32)
    found = best_formula(x, 3e-6 * x**2, np.full(32, 1e-5))
    assert abs(found.values.get("level", 0.0)) < 0.01
    assert found.r2 > 0.9
    limits = bounds("wave", 0.1)
    assert limits["ge"] == pytest.approx(0.05) and limits["le"] == pytest.approx(0.2)


def test_a_dead_laser_loses_no_more_than_all_returns() -> None:
    """Beyond −100 % the likelihood is flat, so that a fit may end anywhere."""
    curve = Curve("drop", ("ring",), ("",), (("0", "1"),), np.array([0.0, -1.0]), np.full(2, 0.01))
    assert "1: −1" in UnknownEffect.of(curve).refitted({"amplitude": 1.02}, {}).form.split(" and ")[0]


def test_no_formula_is_far_larger_between_the_bins_than_in_them() -> None:
    """Two bins far apart with a narrow peak next to one of them: a bell between them would fit with any amplitude."""
    x = np.array([0.07, 0.19, 0.2, 0.25, 0.29, 0.34, 0.42, 0.5])
    y = np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    formula = best_formula(x, y, np.full(len(x), 1e-3))
    assert np.abs(formula.evaluate(np.linspace(0.07, 0.5, 1000))).max() < 0.5
    assert formula.r2 > 0.9


def test_a_curve_that_does_not_change_is_a_constant() -> None:
    """A logarithm of the time of day is nearly constant, too, but explains no more."""
    x = np.linspace(74.0, 90.0, 5)
    formula = best_formula(x, np.array([0.53, 0.46, 0.41, 0.48, 0.47]), np.full(5, 0.08))
    assert formula.family == "constant"
    assert formula.evaluate(x) == pytest.approx(0.47, abs=0.02)

"""The benchmark's own arithmetic."""

from __future__ import annotations

import numpy as np
import pytest

from tests.hidden.amplitudes import STRENGTHS, parameters
from tests.hidden.cases import GROUPS, Case, all_cases
from tests.hidden.drive import Hidden
from tests.hidden.score import relative_error, score

_WALK = {"amplitude_m": 0.05, "decay": 4.0}


def _case(**hidden) -> Case:
    return Case("name", "strong", Hidden(**hidden), "town01_s1", "town04_s1")


def _answer(effects: list[dict], unknown: dict | None = None) -> dict:
    diagnosis = {"verdict": "missing", "effects": effects, "ranking": [], "unknown": unknown}
    held_out = {"held_out_before": {"error": 2.0}, "held_out_after": {"error": 1.1}}
    return {"trouble": "", "wall_s": 1.0, "cpu_s": 1.0, "rss_gib": 1.0, "diagnosis": diagnosis, **held_out}


def test_the_right_effect_and_its_intervals_count() -> None:
    entry = {"effect": "range_walk", "params": {"amplitude_m": 0.06, "decay": 4.0}, "also_possible": []}
    entry["ci95"] = {"amplitude_m": [0.04, 0.07], "decay": [4.5, 5.0]}
    row = score(_case(effects={"range_walk": _WALK}), _answer([entry]), floor=1.0)
    assert row["first_right"] and row["in_set"] and row["exact_set"]
    assert row["parameter_errors"]["range_walk.amplitude_m"] == pytest.approx(0.2)
    assert (row["intervals_held"], row["intervals"]) == (1, 2)
    assert row["held_out_ratio"] == pytest.approx(1.1)
    assert row["explained"] == pytest.approx(0.9)


def test_a_confused_effect_counts_in_the_set_only() -> None:
    entry = {"effect": "range_bias", "params": {"offset_m": 0.02}, "ci95": {}, "also_possible": ["range_walk"]}
    row = score(_case(effects={"range_walk": _WALK}), _answer([entry]), floor=1.0)
    assert not row["first_right"] and row["in_set"] and not row["exact_set"]
    assert row["false_additions"] == 1


def test_whatever_is_said_of_nothing_is_an_alarm() -> None:
    assert not score(_case(), _answer([]), floor=1.0)["alarm"]
    unknown = {"channel": "range", "covariates": ["azimuth"], "form": "a·x", "r2": 0.95}
    assert score(_case(), _answer([], unknown), floor=1.0)["alarm"]


def test_an_effect_without_a_name_wants_channel_and_covariate() -> None:
    case = _case(unnamed={"dirty_window": {"a": 0.5}})
    unknown = {"channel": "intensity", "covariates": ["firing_time"], "form": "", "r2": 0.95}
    row = score(case, _answer([], unknown), floor=1.0)
    assert row["flagged"] and row["right_channel"] and row["right_covariate"]
    wrong = score(case, _answer([], {**unknown, "covariates": ["range"]}), floor=1.0)
    assert not wrong["right_covariate"]


def test_phases_are_compared_on_the_circle() -> None:
    assert relative_error("phase_deg", 359.0, 1.0) == pytest.approx(2 / 360)
    assert relative_error("offsets_m", [3.0, 4.0], [3.0, 5.0]) == pytest.approx(1 / 5)


def test_cases_have_names_of_their_own_and_the_same_truth_every_time() -> None:
    once, again = all_cases(2, 20), all_cases(2, 20)
    assert len({case.name for case in once}) == len(once)
    assert {case.group for case in once} == set(GROUPS)
    assert [case.hidden for case in once] == [case.hidden for case in again]
    assert all(case.base != case.held_out for case in once)


@pytest.mark.parametrize("name", STRENGTHS)
def test_parameters_are_plain_numbers(name: str) -> None:
    drawn = parameters(name, "strong", np.random.default_rng(0), rings=4)
    values = [entry for value in drawn.values() for entry in (value if isinstance(value, list) else [value])]
    assert all(type(value) in (float, str) for value in values)

"""The benchmark's own arithmetic."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.hidden.amplitudes import STRENGTHS, parameters
from tests.hidden.cases import GROUPS, NULLS, Case, all_cases, spread
from tests.hidden.drive import Hidden
from tests.hidden.score import relative_error, score
from tests.hidden.shape import r_squared
from tests.hidden.table import print_failures, print_table

_WALK = {"amplitude_m": 0.05, "decay": 4.0}
_PAIR = {"channel": "range", "size": 0.05, "first": "range", "second": "azimuth", "waves": 1, "phase_deg": 0.0}


def _case(group: str = "strong", **hidden) -> Case:
    return Case("name", group, Hidden(**hidden), "town01_s1", "town04_s1")


def _answer(effects: list[dict], unknown: dict | None = None, **more) -> dict:
    diagnosis = {"verdict": "missing", "effects": effects, "ranking": [], "unknown": unknown}
    diagnosis |= {"error_before": 2.0, "error_after": 1.5, **more}
    held_out = {"held_out_before": 2.0, "held_out_after": 1.1, "held_out_floor": 1.0}
    cost = {"trouble": "", "wall_s": 1.0, "cpu_s": 1.0, "rss_gib": 1.0}
    return {**cost, "floor": 1.0, "diagnosis": diagnosis, **held_out}


def _found(channel: str, *covariates: str, **more) -> dict:
    return {"channel": channel, "covariates": list(covariates), "form": "a·x", "r2": 0.95, "p_value": 0.001, **more}


def test_the_right_effect_and_its_intervals_count() -> None:
    entry = {"effect": "range_walk", "params": {"amplitude_m": 0.06, "decay": 4.0}, "also_possible": []}
    entry["ci95"] = {"amplitude_m": [0.04, 0.07], "decay": [4.5, 5.0]}
    row = score(_case(effects={"range_walk": _WALK}), _answer([entry]))
    assert row["first_right"] and row["in_set"] and row["exact_set"]
    assert row["parameter_errors"]["range_walk.amplitude_m"] == pytest.approx(0.2)
    assert (row["intervals_held"], row["intervals"]) == (1, 2)
    assert row["held_out_ratio"] == pytest.approx(1.1)
    assert row["explained"] == pytest.approx(0.9)


def test_a_confused_effect_counts_in_the_set_only() -> None:
    entry = {"effect": "range_bias", "params": {"offset_m": 0.02}, "ci95": {}, "also_possible": ["range_walk"]}
    row = score(_case(effects={"range_walk": _WALK}), _answer([entry]))
    assert not row["first_right"] and row["in_set"] and not row["exact_set"]
    assert row["false_additions"] == 1


def test_whatever_is_said_of_nothing_is_an_alarm() -> None:
    assert not score(_case("null"), _answer([]))["alarm"]
    assert score(_case("null"), _answer([], _found("range", "azimuth")))["alarm"]
    assert score(_case("null"), _answer([], unknowns=[_found("drop", "ring")]))["alarm"]


def test_the_list_of_what_is_unexplained_must_be_empty_in_a_null() -> None:
    assert score(_case("null"), _answer([]))["unexplained_empty"] is None  # a version that has no such list
    assert score(_case("null"), _answer([], unexplained=[]))["unexplained_empty"] is True
    heavy = score(_case("null"), _answer([], unexplained=[_found("range", "noise_shape")]))
    assert heavy["unexplained_empty"] is False and heavy["unexplained_empty_but_shape"] is True


def test_an_effect_without_a_name_wants_channel_and_covariate() -> None:
    case = _case("unnamed", unnamed={"dirty_window": {"a": 0.5}})
    right = score(case, _answer([], _found("intensity", "firing_time")))
    assert right["told"] and right["told_or_listed"] and right["right_channel"] and right["shape_r2"] == 0.95
    wrong = score(case, _answer([], _found("intensity", "range")))
    assert wrong["flagged"] and wrong["right_channel"] and not wrong["told_or_listed"]
    assert (right["false_unknowns"], wrong["false_unknowns"]) == (0, 1)
    listed = score(case, _answer([], unexplained=[_found("intensity", "azimuth")]))
    assert not listed["told"] and listed["listed"] and listed["told_or_listed"]


def test_a_pair_wants_both_of_its_covariates() -> None:
    case = _case("pair", unnamed={"pair": _PAIR})
    assert score(case, _answer([], unknowns=[_found("range", "firing_time", "range")]))["told"]
    assert not score(case, _answer([], unknowns=[_found("range", "range")]))["told"]


def test_whoever_names_every_covariate_tells_nothing() -> None:
    case = _case("pair", unnamed={"pair": _PAIR})
    everything = _found("range", "range", "azimuth", "ring", "albedo", "speed")
    assert not score(case, _answer([], unknowns=[everything]))["told"]


def test_two_unknowns_are_told_when_each_is() -> None:
    noise = {"channel": "intensity", "law": "uniform", "share": 0.9, "mirrored": False, "size": 0.0}
    case = _case("two_at_once", unnamed={"pair": _PAIR, "noise_shape": noise})
    one, other = _found("range", "range", "azimuth"), _found("intensity_variance", "noise_shape")
    assert not score(case, _answer([], unknowns=[one]))["told_or_listed"]
    row = score(case, _answer([], unknowns=[one], unexplained=[other]))
    assert row["told_or_listed"] and not row["told"]


def test_lasers_offsets_say_what_their_elevations_say() -> None:
    shape = {"covariate": "elevation", "shape": "bell", "centre": 0.5, "width": 0.2}
    case = _case("one_covariate", unnamed={"one_covariate": {"channel": "range", "size": 0.05, **shape}})
    entry = {"effect": "ring_range_offset", "params": {}, "ci95": {}, "also_possible": []}
    row = score(case, _answer([entry]))
    assert row["told"] and row["no_false_effect"]
    assert not score(case, _answer([{**entry, "effect": "range_walk"}]))["no_false_effect"]


def test_the_floor_is_held_against_the_aligned_error_where_there_is_one() -> None:
    assert score(_case("null"), _answer([]))["at_floor"] == pytest.approx(1.5)
    assert score(_case("null"), _answer([], error_aligned=1.04))["at_floor"] == pytest.approx(1.04)


def test_a_budget_adds_up() -> None:
    budget = {"noise": 1.0, "poses": 0.5, "objects": 0.2, "map": 0.1, "missing": 0.1, "unexplained": 0.1}
    assert score(_case("null"), _answer([], budget=budget))["budget_sums"]
    assert not score(_case("null"), _answer([], budget={**budget, "noise": 0.9}))["budget_sums"]


def test_a_table_takes_versions_with_and_without_the_new_lists(capsys: pytest.CaptureFixture[str]) -> None:
    case = _case("unnamed", unnamed={"dirty_window": {"a": 0.5}})
    meta = {"case": case.name, "group": case.group, "level": "strong"}
    old = meta | score(case, _answer([]))
    new = meta | score(case, _answer([], unknowns=[_found("intensity", "azimuth")], unexplained=[]))
    print_table({"old": [old], "new": [new]})
    row = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("in no catalogue: told or"))
    assert row.split()[-4:] == ["0.000", "1", "1.000", "1"]
    failed = meta | score(case, {"trouble": "took longer than 1 s", "wall_s": 1.0, "cpu_s": 1.0, "rss_gib": 1.0})
    print_failures([failed])
    assert "took longer" in capsys.readouterr().out


def test_a_measured_shape_counts_before_a_claimed_one() -> None:
    case = _case("unnamed", unnamed={"dirty_window": {"a": 0.5}})
    answer = _answer([], _found("intensity", "azimuth"))
    assert score(case, answer)["shape_r2"] == 0.95
    assert score(case, answer | {"shape_r2": 0.4})["shape_r2"] == 0.4
    assert score(case, _answer([]))["shape_r2"] == 0.0


def test_a_shape_found_whole_leaves_nothing() -> None:
    true = np.array([0.0, 1.0, 2.0])
    assert r_squared(true, true) == 1.0
    assert r_squared(true, np.ones(3)) == 0.0


def test_phases_are_compared_on_the_circle() -> None:
    assert relative_error("phase_deg", 359.0, 1.0) == pytest.approx(2 / 360)
    assert relative_error("offsets_m", [3.0, 4.0], [3.0, 5.0]) == pytest.approx(1 / 5)


def test_cases_have_names_of_their_own_and_the_same_truth_every_time() -> None:
    once, again = all_cases([0, 7], 20), all_cases([0, 7], 20)
    assert len({case.name for case in once}) == len(once)
    assert {case.group for case in once} == set(GROUPS)
    assert [case.hidden for case in once] == [case.hidden for case in again]
    assert all(case.base != case.held_out for case in once)


def test_half_of_the_cases_have_nuisances_and_their_names_say_so() -> None:
    cases = [case for case in all_cases(range(4), 20) if case.group not in (*NULLS, "disturbed")]
    usual = [case for case in cases if "usual" in case.hidden.nuisances]
    assert len(usual) / len(cases) == pytest.approx(0.5, abs=0.06)
    assert all(("-usual-" in case.name) == (not case.is_exact) for case in cases)
    assert all(case.hidden.range_law in ("student5", "laplace") for case in usual)


def test_truths_survive_json() -> None:
    for case in all_cases([3], 20):
        assert json.loads(json.dumps(case.hidden.unnamed)) == case.hidden.unnamed


def test_a_sample_has_something_of_every_group() -> None:
    sample = spread(all_cases([20, 21], 20), 24)
    assert len(sample) == 24
    assert {case.group for case in sample} == set(GROUPS)


@pytest.mark.parametrize("name", STRENGTHS)
def test_parameters_are_plain_numbers(name: str) -> None:
    drawn = parameters(name, "strong", np.random.default_rng(0), rings=4)
    values = [entry for value in drawn.values() for entry in (value if isinstance(value, list) else [value])]
    assert all(type(value) in (float, str) for value in values)

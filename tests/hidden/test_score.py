"""The benchmark's own arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from tests.hidden.amplitudes import STRENGTHS, parameters
from tests.hidden.base_drives import TOWNS, Base
from tests.hidden.cases import GROUPS, NULL, SENSORS, SINGLE, UNSEEN, Case, all_cases, sample_cases
from tests.hidden.score import curve_r2, parsed_name, r_squared, relative_error, score
from tests.hidden.table import print_failures, print_table
from tests.hidden.truth import Finding

_WALK = {"range_walk": {"amplitude_m": 0.05, "decay": 4.0}}
_BY_AZIMUTH = Finding(("intensity",), (("azimuth", "firing_time"),))


def _case(group: str = SINGLE) -> Case:
    return Case("name-bare-usual-1", group, (), (), "strong", (Base("town01", "hdl64e", 1),), "bare", "usual", 20, 1)


def _answer(
    effects: Sequence[dict] = (),
    unknowns: Sequence[dict] = (),
    findings: Sequence[Finding] = (),
    hidden: dict | None = None,
    **more,
) -> dict[str, Any]:
    diagnosis = {"verdict": "missing" if effects or unknowns else "none", "effects": list(effects), "ranking": []}
    diagnosis |= {"unknowns": list(unknowns), "error_before": 2.0, "error_after": 1.5, **more}
    truth = {"effects": hidden or {}, "unseen": {}, "findings": [finding.to_json() for finding in findings]}
    cost = {"trouble": "", "wall_s": 1.0, "cpu_s": 1.0, "rss_gib": 1.0}
    return {"truth": truth, "floor": 1.0, "diagnose": cost | {"json": diagnosis}, "compare": dict(cost)}


def _found(channel: str, *covariates: str, **more) -> dict:
    return {"channel": channel, "covariates": list(covariates), "form": "a·x", "r2": 0.95, "p_value": 0.001, **more}


def _effect(name: str, **more) -> dict:
    return {"effect": name, "params": {}, "ci95": {}, "also_possible": []} | more


def test_the_right_effect_and_its_intervals_count() -> None:
    entry = _effect("range_walk", params={"amplitude_m": 0.06, "decay": 4.0})
    entry["ci95"] = {"amplitude_m": [0.04, 0.07], "decay": [4.5, 5.0]}
    row = score(_case(), _answer([entry], hidden=_WALK))
    assert row["first_right"] and row["in_set"] and row["exact_set"]
    assert row["parameter_errors"]["range_walk.amplitude_m"] == pytest.approx(0.2)
    assert row["covered"] == [True, False]


def test_a_missed_effect_is_compared_with_what_the_diagnosis_says_that_it_detects() -> None:
    def detectable(hidden: dict, effects: Sequence[dict] = (), **smallest: dict) -> bool | None:
        return score(_case(), _answer(effects, hidden=hidden, smallest_detectable=smallest))["detectable"]

    assert detectable(_WALK, range_walk={"amplitude_m": 0.04}) is True
    assert detectable(_WALK, range_walk={"amplitude_m": 0.06}) is False
    assert detectable(_WALK) is None
    assert detectable(_WALK, [_effect("range_walk")]) is True
    reflector = {"retroreflection": {"gain": 1.5}}
    assert detectable(reflector, retroreflection={"gain": 0.6}) is False, "a gain of 1 changes nothing"
    assert detectable({"ring_gain": {"gains": [0.9, 1.1]}}, ring_gain={"gains": 0.05}) is True


def test_a_confused_effect_counts_in_the_set_only() -> None:
    entry = _effect("range_bias", also_possible=["range_walk"])
    row = score(_case(), _answer([entry], hidden=_WALK))
    assert not row["first_right"] and row["in_set"] and not row["exact_set"]
    assert row["false_effects"] == ["range_bias"]
    either = _answer([_effect("range_bias")], hidden=_WALK, either_or=[["range_bias", "range_walk"]])
    assert score(_case(), either)["in_set"]


def test_a_null_is_right_when_nothing_is_reported_or_listed() -> None:
    null = _case(NULL)
    assert score(null, _answer(unexplained=[]))["null_right"]
    assert not score(null, _answer(unknowns=[_found("range", "azimuth")]))["silent"]
    listed = score(null, _answer(unexplained=[_found("range", "ring")]))
    assert listed["silent"] and not listed["null_right"]
    assert not score(null, _answer(verdict="unknown"))["silent"]
    assert score(null, _answer())["list_empty"] is None  # a version that has no such list


def test_an_unseen_effect_wants_channel_and_covariate() -> None:
    case = _case(UNSEEN)
    right = score(case, _answer(unknowns=[_found("intensity", "firing_time")], findings=[_BY_AZIMUTH]))
    assert right["reported"] and right["reported_or_listed"] and right["reported_first"] and not right["has_false"]
    wrong = score(case, _answer(unknowns=[_found("intensity", "range")], findings=[_BY_AZIMUTH]))
    assert wrong["right_channel"] and not wrong["reported_or_listed"] and wrong["has_false"]
    listed = score(case, _answer(unexplained=[_found("intensity", "azimuth")], findings=[_BY_AZIMUTH]))
    assert not listed["reported"] and listed["reported_or_listed"] and not listed["reported_first"]
    everything = _found("intensity", "azimuth", "ring", "range", "albedo")
    assert not score(case, _answer(unknowns=[everything], findings=[_BY_AZIMUTH]))["reported"]


def test_older_versions_report_one_unknown() -> None:
    answer = _answer(findings=[_BY_AZIMUTH], unknown=_found("intensity", "azimuth"))
    del answer["diagnose"]["json"]["unknowns"]
    assert score(_case(UNSEEN), answer)["reported"]


def test_every_variable_must_be_named_and_a_part_of_them_is_not_false() -> None:
    drift = Finding(("range",), (("frame_time", "scan"), ("ring", "block")))
    part = score(_case(UNSEEN), _answer(unknowns=[_found("range", "ring")], findings=[drift]))
    assert not part["reported"] and not part["has_false"]
    assert score(_case(UNSEEN), _answer(unknowns=[_found("range", "scan", "ring")], findings=[drift]))["reported"]


def test_another_description_of_the_same_data_counts() -> None:
    vibration = Finding(
        ("azimuth_error",), (("time",),), also=(Finding(("azimuth_error",), (("azimuth",), ("scan",))),)
    )
    named = [_found("azimuth_error", "azimuth", "scan")]
    assert score(_case(UNSEEN), _answer(unknowns=named, findings=[vibration]))["reported"]


def test_two_unseen_effects_are_reported_when_each_is() -> None:
    loss = Finding(("drop",), (("ring",),))
    one, other = _found("intensity", "azimuth"), _found("drop", "ring")
    findings = [_BY_AZIMUTH, loss]
    assert not score(_case(UNSEEN), _answer(unknowns=[one], findings=findings))["reported_or_listed"]
    row = score(_case(UNSEEN), _answer(unknowns=[one], unexplained=[other], findings=findings))
    assert row["reported_or_listed"] and not row["reported"]


def test_a_catalogue_effect_may_say_the_same_or_be_additional() -> None:
    weak = Finding(("intensity",), (("ring",),), effects=("ring_gain",), beside=("intensity_noise",))
    row = score(_case(UNSEEN), _answer([_effect("ring_gain"), _effect("intensity_noise")], findings=[weak]))
    assert row["reported"] and row["reported_first"] and not row["has_false"]
    assert score(_case(UNSEEN), _answer([_effect("range_walk")], findings=[weak]))["has_false"]


def test_names_of_an_either_or_set_are_findings() -> None:
    assert parsed_name("elevation_error by range x azimuth") == {
        "channel": "elevation_error", "covariates": ["range", "azimuth"]
    }  # fmt: skip
    assert parsed_name("unknown_drop_by_frame_time_and_ring")["covariates"] == ["frame_time", "ring"]
    assert parsed_name("range_walk") == {"channel": "range_walk", "covariates": []}
    answer = _answer(findings=[_BY_AZIMUTH], either_or=[["intensity by ring", "intensity by azimuth"]])
    row = score(_case(UNSEEN), answer)
    assert row["in_either_or"] and not row["reported"]


def test_the_floor_is_compared_with_the_aligned_error_where_there_is_one() -> None:
    assert score(_case(NULL), _answer())["at_floor"] == pytest.approx(1.5)
    assert score(_case(NULL), _answer(error_aligned=1.04))["at_floor"] == pytest.approx(1.04)


def test_budgets_of_both_commands_are_compared() -> None:
    budget = {"noise": 1.0, "poses": 0.5, "objects": 0.2, "map": 0.1, "missing": 0.1, "unexplained": 0.1}
    answer = _answer(budget=budget)
    answer["compare"]["json"] = {"error": 2.0, "budget": budget | {"poses": 0.2, "missing": 0.4}}
    row = score(_case(), answer)
    assert row["budgets_apart"] == pytest.approx(0.15) and not row["budgets_agree"]
    assert row["missing_share"] == pytest.approx(0.4 / 0.5)
    answer["compare"]["json"]["budget"] = {name: 3 * value for name, value in budget.items()} | {"noise": 1.0}
    assert score(_case(), answer)["budgets_agree"], "other frames, with the same sources of a larger error"


def test_a_table_takes_versions_with_and_without_the_new_lists(capsys: pytest.CaptureFixture[str]) -> None:
    case = _case(UNSEEN)
    old = score(case, _answer(findings=[_BY_AZIMUTH]))
    new = score(case, _answer(unknowns=[_found("intensity", "azimuth")], unexplained=[], findings=[_BY_AZIMUTH]))
    print_table({"old": [old], "new": [new]})
    lines = capsys.readouterr().out.splitlines()
    row = next(line for line in lines if line.startswith("unseen, one or two at once: reported or listed"))
    assert row.split()[-4:] == ["0.000", "1", "1.000", "1"]
    failed = score(case, {"diagnose": {"trouble": "took longer than 1 s"}})
    assert failed["verdict"] == "failed"
    print_failures([failed, old, new])
    assert "took longer" in capsys.readouterr().out


def test_a_measured_shape_counts_before_a_reported_curve() -> None:
    x = np.linspace(0, 10, 20)
    true = Finding(
        ("range",), (("range",),), curve={"covariate": "range", "unit": "m", "x": x.tolist(), "y": (x**2).tolist()}
    )
    curve = {"x": x.tolist(), "y": (x**2 - 3).tolist(), "sigma": np.ones(20).tolist()}
    answer = _answer(unknowns=[_found("range", "range", curve=curve)], findings=[true])
    assert score(_case(UNSEEN), answer)["shape_r2"] == pytest.approx(1)
    assert score(_case(UNSEEN), answer | {"shape_r2": 0.4})["shape_r2"] == 0.4
    assert score(_case(UNSEEN), _answer(findings=[true]))["shape_r2"] == 0.0
    assert (curve_r2(true, _found("range", "range", curve=curve | {"y": (-(x**2)).tolist()})) or 0) < 0


def test_a_completely_detected_shape_leaves_nothing() -> None:
    true = np.array([0.0, 1.0, 2.0])
    assert r_squared(true, true) == 1.0
    assert r_squared(true, np.ones(3)) == 0.0


def test_phases_are_compared_on_the_circle() -> None:
    assert relative_error("phase_deg", 359.0, 1.0) == pytest.approx(2 / 360)
    assert relative_error("offsets_m", [3.0, 4.0], [3.0, 5.0]) == pytest.approx(1 / 5)


def test_cases_have_names_of_their_own_and_are_the_same_every_time() -> None:
    once, again = all_cases([3, 7]), all_cases([3, 7])
    assert once == again
    assert len({case.name for case in once}) == len(once)
    assert {case.group for case in once} == set(GROUPS)
    assert {base.town for case in once for base in case.bases} == set(TOWNS)


def test_two_seeds_have_forty_nulls_of_all_sorts() -> None:
    nulls = [case for case in all_cases([3, 7]) if case.group == NULL]
    assert len(nulls) >= 40
    for seed in (3, 7):
        of_seed = [case for case in nulls if case.bases[0].seed == seed]
        assert len({case.bases[0].town for case in of_seed}) >= 2
        assert len({case.bases[0].pattern for case in of_seed}) >= 2
        assert {case.sensor for case in of_seed} == set(SENSORS)
        assert {case.nuisance for case in of_seed} == {"usual", "harder"}


def test_a_sample_has_something_of_every_group() -> None:
    sample = sample_cases(all_cases([20, 21]), 24)
    assert len(sample) == 24
    assert {case.group for case in sample} == set(GROUPS)


@pytest.mark.parametrize("name", STRENGTHS)
def test_parameters_are_plain_numbers(name: str) -> None:
    drawn = parameters(name, "strong", np.random.default_rng(0), rings=4)
    values = [entry for value in drawn.values() for entry in (value if isinstance(value, list) else [value])]
    assert all(type(value) in (float, str) for value in values)

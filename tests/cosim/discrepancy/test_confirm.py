"""Frames that took no part strike what they deny, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.data.split import Split
from cosim.discrepancy.diagnose import case_of
from cosim.discrepancy.eliminate import assured, confirmed, contradicted
from cosim.discrepancy.settings import Settings
from cosim.discrepancy.state import Case, Found, Model, State, given, viewed
from sensors.effects.points.incidence_bias import IncidenceBias
from sensors.effects.points.range_bias import RangeBias
from tests.cosim.discrepancy.small_drive import Yard


@pytest.fixture(scope="module")
def case(biased_yard: Yard) -> Case:
    """The measured ranges are 4 cm too long."""
    case = case_of(opened(biased_yard.drive), biased_yard.sensor, settings=Settings(rows=8_000))
    names = (*case.split.fit, *case.split.test)
    return replace(case, split=Split(names[:-2], names[:-2], names[-2:]))


def believing(case: Case, offset_m: float) -> State:
    """Where a diagnosis stands that found such a bias."""
    effects = (*given(case), RangeBias(offset_m=offset_m))
    view = viewed(case, case.split.fit, Model(effects), 8_000)
    found = Found("range_bias", 0.001)
    return State(Model(effects, (len(effects) - 1,)), view, view, (found,))


def test_what_is_there_is_confirmed(case: Case) -> None:
    assert contradicted(case, believing(case, 0.04), Model(given(case))) is None


def test_what_is_not_there_is_struck_out_and_noted(case: Case) -> None:
    state = believing(case, -0.02)
    assert contradicted(case, state, Model(given(case))) is state.found[0]
    after = confirmed(case, state)
    assert not after.found and after.struck == state.found
    assert [one.name for one in after.model.effects] == [one.name for one in given(case)]


def test_without_a_segment_to_spare_nothing_is_struck(case: Case) -> None:
    bare = replace(case, split=Split(case.split.fit, case.split.test))
    assert contradicted(bare, believing(bare, -0.02), Model(given(bare))) is None


def test_what_may_be_nothing_by_its_own_interval_is_no_finding(case: Case) -> None:
    effects = (*given(case), RangeBias(offset_m=0.04), IncidenceBias(gain_m=0.0))
    view = viewed(case, case.split.fit, Model(effects, (len(effects) - 2, len(effects) - 1)), 8_000)
    model = Model(view.fitted.effects, (len(effects) - 2, len(effects) - 1))
    state = State(model, view, view, (Found("range_bias", 0.001), Found("incidence_bias", 0.04)))
    after = assured(case, state)
    assert [one.effect for one in after.found] == ["range_bias"] and after.model.place_of("incidence_bias") is None
    assert assured(case, after) is after

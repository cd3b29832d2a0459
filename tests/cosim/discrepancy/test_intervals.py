"""What is surely on is not asked for again."""

from __future__ import annotations

from cosim.discrepancy.inference.intervals import plainly_on
from sensors.effects.points.range_bias import RangeBias
from tests.cosim.discrepancy.small_drive import Yard, viewed_yard


def test_an_effect_is_plainly_on_where_it_is_far_from_what_was_given(biased_yard: Yard) -> None:
    view = viewed_yard(biased_yard, (RangeBias(offset_m=0.0),), free=(0,))
    found = view.fitted.effects[0]
    assert plainly_on(view.fitter, view.fitted, ()) == {0}
    assert plainly_on(view.fitter, view.fitted, (RangeBias(offset_m=-0.04),)) == {0}
    assert plainly_on(view.fitter, view.fitted, (found,)) == frozenset()

"""Tables of returns: merging and replacing keep every beam's rows, in order."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sensors.returns import Returns

beams = st.lists(st.integers(0, 30), unique=True, max_size=20).map(sorted)


def table(beam, value, number=0):
    n = len(beam)
    made = Returns.spurious(np.array(beam, int), np.full(n, value), np.arange(n) / 100)
    return Returns(**{**vars(made), "return_no": np.full(n, number, np.uint8)})


@given(own=beams, theirs=beams)
def test_replacing_beams_takes_the_other_table_s_rows_where_it_has_some(own, theirs):
    after = table(own, 1.0).replacing_beams(table(theirs, 2.0))
    expected = {**dict.fromkeys(own, 1.0), **dict.fromkeys(theirs, 2.0)}
    assert after.beam.tolist() == sorted(expected)
    assert after.range_m.tolist() == [expected[beam] for beam in sorted(expected)]


@given(own=beams, theirs=beams)
def test_of_a_beam_with_two_returns_both_are_replaced(own, theirs):
    twice = table(own, 1.0).merged(table(own, 3.0, number=1))
    after = twice.replacing_beams(table(theirs, 2.0))
    left = [beam for beam in own if beam not in theirs]
    assert after.beam.tolist() == sorted([*left, *left, *theirs])


@given(own=beams, theirs=beams)
def test_merging_loses_nothing_and_sorts_by_beam_and_number(own, theirs):
    both = table(theirs, 2.0, number=1).merged(table(own, 1.0))
    rows = list(zip(both.beam.tolist(), both.return_no.tolist(), strict=True))
    assert rows == sorted([*((beam, 0) for beam in own), *((beam, 1) for beam in theirs)])
    assert (both.range_m == np.where(both.return_no == 1, 2.0, 1.0)).all()

"""Frames that judge took no part, tell of all that is asked, and count by what they show."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.held_out import split_frames
from cosim.discrepancy.testing import HeldOut


@pytest.mark.parametrize("count", [8, 15, 60])
def test_no_frame_both_fits_and_judges(count: int) -> None:
    names = [f"{row:06d}" for row in range(count)]
    split = split_frames(names)
    assert split.is_held_out
    assert sorted((*split.fit, *split.test)) == names


def test_frames_that_tell_little_judge_no_more_than_their_share() -> None:
    names = [f"{row:06d}" for row in range(16)]
    poor = names[3::4]  # each of which would judge by its place alone
    split = split_frames(names, poor)
    assert len(set(split.test) & set(poor)) <= 2
    assert len(split.test) == 4


def test_a_frame_of_few_beams_does_not_outvote_many() -> None:
    beams = np.array([40_000, 40_000, 40_000, 20])
    before = HeldOut(3.0, np.array([3.0, 3.1, 2.9, 3.0]), beams, None)
    after = HeldOut(2.0, np.array([2.0, 2.0, 2.0, 9.0]), beams, None)
    assert after.beats(before)
    assert not before.beats(after)
    assert after.standard_error < 0.1

"""Frames that judge took no part, and tell of all that is asked."""

from __future__ import annotations

import pytest

from cosim.discrepancy.data.split import split_frames


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

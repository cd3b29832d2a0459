"""Frames that judge took no part, and tell of all that is asked."""

from __future__ import annotations

import pytest

from cosim.discrepancy.data.split import split_frames


@pytest.mark.parametrize("count", [8, 15, 60])
def test_no_frame_both_fits_and_judges(count: int) -> None:
    names = [f"{row:06d}" for row in range(count)]
    split = split_frames(names)
    assert split.is_held_out
    assert sorted((*split.fit, *split.test, *split.confirm)) == names


@pytest.mark.parametrize(("count", "untouched"), [(15, 0), (16, 2), (20, 2), (60, 3)])
def test_the_last_segment_of_a_drive_that_can_spare_it_is_left_for_the_end(count: int, untouched: int) -> None:
    names = [f"{row:06d}" for row in range(count)]
    assert split_frames(names).confirm == tuple(names[count - untouched :])


def test_frames_that_tell_little_judge_no_more_than_their_share() -> None:
    names = [f"{row:06d}" for row in range(16)]
    poor = names[3::4]  # each of which would judge by its place alone
    split = split_frames(names, poor)
    assert len(set(split.test) & set(poor)) <= 2
    assert len(split.test) == 4
    assert not split.confirm


def test_frames_that_tell_little_confirm_nothing() -> None:
    names = [f"{row:06d}" for row in range(24)]
    split = split_frames(names, names[-4:])
    assert split.confirm == tuple(names[17:20])

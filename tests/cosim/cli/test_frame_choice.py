"""Frames by name or by number."""

import pytest

from cosim.cli.frame_choice import chosen_frames, evenly
from cosim.drives.kitti import Drive
from cosim.errors import DriveError


def test_frames_by_number_are_spread_evenly_and_by_name_come_in_order_of_naming(blind_drive):
    drive = Drive(blind_drive)
    assert chosen_frames(drive, "2") == (drive.frames[0], drive.frames[-1])
    assert chosen_frames(drive, "99") == drive.frames
    assert chosen_frames(drive, "000001, 000000,000001") == ("000001", "000000")


@pytest.mark.parametrize("wrong", ["", ",", "0", "000099", "000000,nothing"])
def test_frames_that_are_none_are_refused_in_one_line(blind_drive, wrong):
    with pytest.raises(DriveError) as caught:
        chosen_frames(Drive(blind_drive), wrong)
    assert "\n" not in str(caught.value)


def test_first_and_last_are_among_those_that_are_spread():
    assert evenly(tuple("abcdefg"), 3) == ("a", "d", "g")

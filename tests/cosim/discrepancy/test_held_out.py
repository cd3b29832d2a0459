"""Frames that judge took no part, tell of all that is asked, and count by what they show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.data.frames import FrameTracer
from cosim.discrepancy.data.split import split_frames
from cosim.discrepancy.validation import HeldOut, held_out_errors
from sensors.effects.range_noise import RangeNoise
from sensors.sensor_model import load_sensor
from tests.cosim.discrepancy.small_drive import make_yard


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


def test_neighbours_tell_whether_noise_is_as_stated(tmp_path: Path) -> None:
    stated, true = RangeNoise(sigma_m=0.01), RangeNoise(sigma_m=0.013)
    yard = make_yard(tmp_path, (true,), known=({"effect": "range_noise", "sigma_m": 0.01},), frames=4)
    drive, sensor = opened(yard.drive), load_sensor(yard.sensor)
    tracer, names = FrameTracer(drive, sensor), tuple(drive.frames)
    said, right = (held_out_errors(tracer, names, (one,), sensor.origin) for one in (stated, true))
    assert [frame["range"] for frame in said.scatter] == pytest.approx([0.69] * 4, abs=0.15)
    assert [frame["range"] for frame in right.scatter] == pytest.approx([0.0] * 4, abs=0.1)
    assert right.scatters_as_stated(said, "range") and not said.scatters_as_stated(right, "range")
    assert not right.scatters_as_stated(right, "range"), "what is as stated needs no other values"
    assert not right.scatters_as_stated(said, "intensity"), "where no noise is stated none is judged"

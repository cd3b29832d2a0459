"""Held-out frames are not fitted and represent all frames."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.data.split import split_frames, split_of_maps


@pytest.mark.parametrize("count", [8, 15, 60])
def test_no_frame_is_both_fitted_and_held_out(count: int) -> None:
    names = [f"{row:06d}" for row in range(count)]
    split = split_frames(names)
    assert split.is_held_out
    assert sorted((*split.fit, *split.test)) == names


def test_poor_frames_are_held_out_in_proportion() -> None:
    names = [f"{row:06d}" for row in range(16)]
    poor = names[3::4]  # each of which would be held out by its position
    split = split_frames(names, poor)
    assert len(set(split.test) & set(poor)) <= 2
    assert len(split.test) == 4


def on_the_way(count: int, waits: range = range(0)) -> dict[str, np.ndarray]:
    """Positions of a sensor that moves half a metre from frame to frame, with some stops."""
    steps = [0.0 if row in waits else 0.5 for row in range(count)]
    return {f"{row:06d}": np.array([x, 0.0, 1.8]) for row, x in enumerate(np.cumsum(steps))}


def test_frames_cover_a_single_map_and_the_middles_of_several_maps() -> None:
    names, places = [f"{row:06d}" for row in range(2000)], on_the_way(2000)
    alone = split_of_maps([names[:140]], [names[140:155]], places, 133_312)
    assert (len(alone.fit), len(alone.test)) == (24, 12) and alone.fit[0] == names[0] and alone.fit[-1] == names[139]
    parts = [names[start : start + 150] for start in range(0, 1950, 150)]
    several = split_of_maps([part[:132] for part in parts], [part[132:] for part in parts], places, 28_800)
    assert several.is_held_out and len(several.fit) == 13 * 6
    steps = [int(after) - int(before) for before, after in zip(several.fit[:5], several.fit[1:6], strict=True)]
    assert max(steps) <= 8
    assert abs(np.mean([int(name) for name in several.fit[:6]]) - 66) < 2


def test_frames_come_from_a_stretch_with_motion_and_validation_scans_are_close_to_it() -> None:
    names, waits = [f"{row:06d}" for row in range(600)], range(30, 90)
    parts = [names[start : start + 150] for start in range(0, 600, 150)]
    fit, held_out = [[name for name in part if int(name) % 10] for part in parts], [part[::10] for part in parts]
    places = on_the_way(600, waits)
    split = split_of_maps(fit, held_out, places, 28_800)
    assert int(split.fit[0]) >= 80 and int(split.fit[5]) < 150
    fitted, for_validation = ([places[name][0] for name in subset] for subset in (split.fit[:6], split.test[:3]))
    assert min(fitted) - 5 <= min(for_validation) and max(for_validation) <= max(fitted) + 5


def test_number_of_frames_does_not_grow_with_the_drive() -> None:
    names, places = [f"{row:06d}" for row in range(36000)], on_the_way(36000)
    parts = [names[start : start + 150] for start in range(0, 36000, 150)]
    split = split_of_maps([part[:132] for part in parts], [part[132:] for part in parts], places, 133_312)
    assert 133_312 * len(split.fit + split.test) <= 5_000_000

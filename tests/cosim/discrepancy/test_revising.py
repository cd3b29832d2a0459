"""What was added stays only as long as it does something."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.discrepancy.revising import is_idle
from cosim.discrepancy.settling import Settled
from sensors.effects.range_bias import RangeBias
from sensors.effects.range_noise import RangeNoise
from sensors.effects.range_walk import RangeWalk
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import Yard, make_yard, settled

NOISY = RangeNoise(sigma_m=0.01)


def _with_a_bias(yard: Yard) -> Settled:
    """The yard with a bias of ranges fitted, whether it has one or not."""
    return settled(yard, (RangeBias(offset_m=0.0), NOISY), free=[0])


def test_what_was_there_is_not_idle(biased_yard: Yard) -> None:
    found = _with_a_bias(biased_yard)
    assert not is_idle(found.fitter, found.fitted, 0, clearly=5.0)


@pytest.mark.parametrize("seed", range(3))
def test_what_may_as_well_be_nothing_is_idle(tmp_path: Path, seed: int) -> None:
    found = _with_a_bias(make_yard(tmp_path, (NOISY,), known=(NOISE,), frames=8, seed=seed))
    assert abs(found.fitted.effects[0].offset_m) < 0.002  # pyright: ignore[reportAttributeAccessIssue]
    assert is_idle(found.fitter, found.fitted, 0, clearly=5.0)


def test_so_is_what_was_said_before(biased_yard: Yard) -> None:
    found = _with_a_bias(biased_yard)
    assert is_idle(found.fitter, found.fitted, 0, clearly=5.0, said=found.fitted.effects[0])
    assert not is_idle(found.fitter, found.fitted, 0, clearly=5.0, said=RangeBias(offset_m=0.03))


def test_what_only_has_a_place_it_does_not_mind_is_there(biased_yard: Yard) -> None:
    """One delay suits a constant bias with any decay, if its amplitude follows: unsure of both, sure of the delay."""
    yard = settled(biased_yard, (RangeWalk(amplitude_m=0.04, decay=0.5), NOISY), free=[0])
    assert not is_idle(yard.fitter, yard.fitted, 0, clearly=5.0)

"""Beams of several frames replayed at once have the same prediction as those of each frame."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.forward.joined import Expected, SampleReplay
from sensors.effects.base import Effect
from sensors.effects.registry import effect_classes
from tests.cosim.discrepancy.small_drive import fit_yard, make_yard


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> SampleReplay:
    yard = make_yard(tmp_path_factory.mktemp("yard"), (), frames=3)
    return fit_yard(yard).fitter.sample.replay


def one_by_one(replay: SampleReplay, effects: tuple[Effect, ...]) -> Expected:
    parts = [SampleReplay([one]).expect(effects) for one in replay.frames]
    columns = {
        name: np.concatenate([getattr(part.of, name) for part in parts])
        for name in ("range_m", "range_sigma_m", "intensity", "intensity_sigma", "seen", "silent", "elsewhere")
    }
    rest = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("along_m", "above_m", "spurious_per_m", "split")
    )
    of_reflectance = np.concatenate([part.log_odds_by_reflectance() for part in parts])
    return Expected(type(parts[0].of)(**columns), *rest, lambda: of_reflectance)


DRAWN = ("intensity_floor",)  # its mean is one of a few draws, which differ
NAMES = sorted(kind.name for kind in effect_classes().values() if kind.neutral and kind.name not in DRAWN)


@pytest.mark.parametrize("name", NAMES)
def test_frames_at_once_and_one_by_one_agree(replay: SampleReplay, name: str) -> None:
    kind = effect_classes()[name]
    effects = (kind.model_validate(kind.example),)
    if any(np.ndim(value) for value in kind.example.values()):
        pytest.skip("its example is for another number of lasers")
    found, expected = replay.expect(effects), one_by_one(replay, effects)
    for part in ("range_m", "range_sigma_m", "intensity", "intensity_sigma", "seen", "silent", "elsewhere"):
        np.testing.assert_allclose(getattr(found.of, part), getattr(expected.of, part), atol=1e-5, err_msg=part)
    for part in ("along_m", "above_m", "spurious_per_m", "split"):
        np.testing.assert_allclose(getattr(found, part), getattr(expected, part), atol=1e-6, err_msg=part)
    slopes = found.log_odds_by_reflectance(), expected.log_odds_by_reflectance()
    np.testing.assert_allclose(*slopes, rtol=1e-3, atol=1e-3)


def test_footprints_of_all_frames_are_evaluated_at_once(replay: SampleReplay) -> None:
    types = effect_classes()
    effects = types["elevation_offset"](offset_deg=0.3), types["beam_divergence"](divergence_mrad=3.0, pulse_ns=6.0)
    found, expected = replay._together.expect(effects), one_by_one(replay, effects)
    np.testing.assert_array_equal(found.of.range_m, expected.of.range_m)
    np.testing.assert_array_equal(found.of.elsewhere, expected.of.elsewhere)
    assert found.of.elsewhere.any()


def test_what_was_was_left_is_returned_to(replay: SampleReplay) -> None:
    types = effect_classes()
    turned = types["elevation_offset"](offset_deg=0.3)
    before = replay.expect(())
    moved = replay.expect((turned,))
    assert np.nanmax(np.abs(moved.of.range_m - before.of.range_m)) > 0.05
    np.testing.assert_array_equal(replay.expect(()).of.range_m, before.of.range_m)

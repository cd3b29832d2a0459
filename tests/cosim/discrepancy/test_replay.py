"""Beams of several frames replayed at once have the same prediction as those of each frame."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.forward.joined import Expected, SampleReplay
from sensors.effects.base import Effect
from sensors.effects.expectation import ExpectationMemo, expect
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
        np.concatenate([getattr(part, name) for part in parts]) for name in ("along_m", "above_m", "spurious_per_m")
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
    for part in ("along_m", "above_m", "spurious_per_m"):
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


FIELDS = (
    ("reflectance_field", {"surfaces": "road", "sigma": 0.4, "cell_m": 0.2}),
    ("detection_threshold", {"threshold": 0.2, "softness": 0.05}),
    (
        "surface_relief",
        {"surfaces": "vehicle", "coarse_sigma_m": 0.02, "coarse_m": 0.2, "fine_sigma_m": 0, "fine_m": 0.05},
    ),
    ("range_noise", {"sigma_m": 0.01}),
)


def test_textures_on_objects_of_all_frames_are_evaluated_at_once(replay: SampleReplay) -> None:
    effects = tuple(effect_classes()[name](**parameters) for name, parameters in FIELDS)
    found, expected = replay._together.expect(effects), one_by_one(replay, effects)
    for part in ("range_m", "intensity", "seen"):
        np.testing.assert_allclose(getattr(found.of, part), getattr(expected.of, part), atol=1e-6, err_msg=part)
    bare = replay._together.expect(effects[-1:])
    assert np.nanmax(np.abs(found.of.range_m - bare.of.range_m)) > 0.01, "relief of vehicles changes ranges"


def test_a_model_that_resumes_after_another_one_is_the_same(replay: SampleReplay) -> None:
    """Whatever was evaluated before, in any order, with known textures and averaged over unknown ones."""
    effects = [effect_classes()[name](**parameters) for name, parameters in FIELDS]
    models = [tuple(effects)]
    for row, values in ((1, {"threshold": 0.3}), (3, {"sigma_m": 0.05}), (0, {"sigma": 0.1}), (1, {"softness": 0.1})):
        models.append((*effects[:row], effects[row].model_copy(update=values), *effects[row + 1 :]))
    shot = replay._together.shot(())
    for is_known in (True, False):
        shot.is_texture_known = is_known
        memo, fresh = ExpectationMemo(), [expect(model, shot) for model in models]
        for number in (0, 1, 2, 0, 3, 4, 1, 0):
            found = expect(models[number], shot, memo=memo)
            for name, values in vars(fresh[number]).items():
                np.testing.assert_array_equal(getattr(found, name), values, err_msg=name)
    shot.is_texture_known = True

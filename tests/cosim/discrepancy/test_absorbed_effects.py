"""Effects that pose errors imitate: pose errors absorb them in the first fit, and give them back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.analysis import FittedFrames, context_of
from cosim.discrepancy.candidates import unknowns
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.dictionary.effects import effect_groups
from cosim.discrepancy.dictionary.linearisation import linearise
from cosim.discrepancy.inference.derivatives import difference_quotients
from cosim.discrepancy.selection.evidence import gather_evidence
from cosim.discrepancy.selection.refit import FittedModel, refit_with
from cosim.discrepancy.selection.table import GroupTest
from sensors.effects.beams.mount_rotation import MountRotation
from sensors.effects.surfaces.beam_divergence import BeamDivergence
from tests.cosim.discrepancy.small_drive import Yard, fit_yard, make_yard
from tests.cosim.discrepancy.test_random_effects import shaken_yard

PITCH_DEG = 0.4


@pytest.fixture(scope="module")
def tilted(tmp_path_factory: pytest.TempPathFactory) -> Yard:
    return shaken_yard(tmp_path_factory.mktemp("tilted"), MountRotation(pitch_deg=PITCH_DEG))


def _result(on: FittedFrames, yard: Yard) -> GroupTest:
    context = context_of(opened(yard.drive), yard.sensor)
    model = FittedModel(on.frames, on.fitter, on.fitted)
    groups = effect_groups(linearise(on.fitter, on.fitted, on.frames), [MountRotation], (), ())
    results = gather_evidence(model, groups, context.settings, 0).results
    return next(one for one in results if one.group.name.startswith("mount_rotation [pitch_deg"))


def test_ranges_at_edges_change_as_with_a_pose_error(tmp_path: Path) -> None:
    """Where a footprint meets two surfaces, the mean of both jumps; the range of its centre does not."""
    fitter = fit_yard(make_yard(tmp_path), (BeamDivergence(divergence_mrad=3.0, pulse_ns=6.0),)).fitter
    sample, effects = (
        fitter.sample,
        (MountRotation(roll_deg=0, pitch_deg=0, yaw_deg=0), BeamDivergence(divergence_mrad=3.0, pulse_ns=6.0)),
    )
    unknown = next(one for one in unknowns(MountRotation) if one.name == "pitch_deg")
    slope = difference_quotients(sample, effects, 0, unknown, unknown.step, sample.predict(effects))["range"]
    as_pose = np.radians(sample.pose_derivative[:, 4])
    edges = sample.border & np.isfinite(sample.range_m) & (sample.cos_incidence > 0.05)
    assert edges.sum() > 100
    left = (slope - as_pose)[edges]
    assert np.sum(left**2) < 1e-3 * np.sum(as_pose[edges] ** 2)


def test_pose_errors_give_back_what_they_absorbed(tilted: Yard) -> None:
    on = fit_yard(tilted)
    assert np.degrees(on.fitter.random.poses(on.fitted.estimate)[:, 4]) == pytest.approx(PITCH_DEG, abs=0.1)
    result = _result(on, tilted)
    assert result.entry.is_of_random
    model, linearisation = FittedModel(on.frames, on.fitter, on.fitted), linearise(on.fitter, on.fitted, on.frames)
    after, _ = refit_with(
        model, linearisation, result.group, result.entry.start, fine=False, steps=4, absorbed=result.entry.absorbed
    )
    pitch = next(effect.pitch_deg for effect in after.fitted.effects if isinstance(effect, MountRotation))
    assert pitch == pytest.approx(PITCH_DEG, rel=0.1)
    assert after.loglik > model.loglik + 20


def test_twelve_scans_that_agree_are_significant(tilted: Yard) -> None:
    assert 1000 * _result(fit_yard(tilted), tilted).entry.p_of_predictions() < 0.05

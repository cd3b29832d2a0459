"""Random effects are estimated with their standard deviations and do not absorb missing effects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cosim.discrepancy.analysis import FittedFrames, context_of, edge_tolerance, fit_held_out
from cosim.discrepancy.budget import budget_of
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.dictionary.covariates import refined, sample_covariates
from cosim.discrepancy.dictionary.effects import effect_groups
from cosim.discrepancy.dictionary.groups import binned_group
from cosim.discrepancy.dictionary.linearisation import linearise
from cosim.discrepancy.inference.projection import PART
from cosim.discrepancy.inference.random_effects import Estimate
from cosim.discrepancy.selection.confirm import p_of_gain
from cosim.discrepancy.selection.evidence import gather_evidence
from cosim.discrepancy.selection.refit import FittedModel, refit_with
from cosim.discrepancy.selection.table import GroupTest
from cosim.discrepancy.settings import DEFAULT
from cosim.drives.twin import read_glb, write_frame, write_glb
from cosim.drives.twin.frame import read_frame
from sensors.effects.base import Effect
from sensors.effects.detection.detection_threshold import DetectionThreshold
from sensors.effects.points.range_bias import RangeBias
from sensors.effects.points.range_noise import RangeNoise
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import Yard, fit_yard, make_yard

SHIFT_M, TURN_DEG = 0.02, 0.1
NOISY = (RangeNoise(sigma_m=0.01, sigma_per_m=0.0),)


def shaken_yard(folder: Path, *effects: Effect) -> Yard:
    """A yard whose twin has a random shift and rotation of each pose of the vehicle."""
    yard = make_yard(folder, (*effects, *NOISY), known=(NOISE,), frames=12)
    rng = np.random.default_rng(3)
    for path in sorted((yard.drive / "twin/frames").glob("*.json")):
        twin = read_frame(path)
        error = np.eye(4)
        error[:3, :3] = Rotation.from_rotvec(np.radians(TURN_DEG) * rng.standard_normal(3) * (0, 0, 1)).as_matrix()
        error[:3, 3] = SHIFT_M * rng.standard_normal(3) * (1, 1, 0)
        write_frame(path, replace(twin, ego=replace(twin.ego, pose=twin.ego.pose @ error)))
    return yard


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> Yard:
    return make_yard(tmp_path_factory.mktemp("exact"), NOISY, known=(NOISE,), frames=8)


@pytest.fixture(scope="module")
def shaken(tmp_path_factory: pytest.TempPathFactory) -> Yard:
    return shaken_yard(tmp_path_factory.mktemp("shaken"))


def test_standard_deviation_of_exact_poses_is_negligible(exact: Yard) -> None:
    view = fit_yard(exact)
    spread = view.fitter.random.spread(view.fitted.estimate, "poses")
    assert np.all(spread[:3] < 2e-3)
    assert np.all(np.degrees(spread[3:]) < 0.01)


def test_standard_deviation_of_pose_errors_is_recovered(shaken: Yard) -> None:
    view = fit_yard(shaken)
    spread = view.fitter.random.spread(view.fitted.estimate, "poses")
    assert spread[:2] == pytest.approx([SHIFT_M] * 2, rel=0.6)
    assert spread[2] < SHIFT_M / 3
    assert np.degrees(spread[5]) == pytest.approx(TURN_DEG, rel=0.6)


def test_nothing_shows_where_only_poses_are_off(shaken: Yard) -> None:
    assert min((one.p_value for one in _tested(fit_yard(shaken), shaken) if one.gain > 3), default=1.0) > 0.01


def test_whole_scans_are_the_clusters_of_what_their_beams_have_in_common(shaken: Yard) -> None:
    on = fit_yard(shaken)
    sample, names = on.fitter.sample, on.fitter.sample.names
    linearisation = linearise(on.fitter, on.fitted, on.frames)
    covariates = {one.name: one for one in sample_covariates(sample, on.fitted.prediction, on.frames)}
    assert len(covariates["frame_time"]) == len(names) // DEFAULT.dictionary.scans_in_bin
    assert len(refined(covariates["frame_time"], sample)) == len(names)
    group = binned_group(linearisation, "azimuth_error", covariates["frame_time"], fewest=1)
    assert group is not None and group.is_of_scan
    other = binned_group(linearisation, "azimuth_error", covariates["range"], fewest=1)
    assert other is not None and not other.is_of_scan
    crossed = covariates["range"].crossed(covariates["frame_time"])
    assert not crossed.is_of_scan and len(refined(crossed, sample)) == len(covariates["range"]) * len(names)
    rows = {
        one.group.is_of_scan: len(one.entry.tables[PART])
        for one in _tested(on, shaken)[::-1]
        if one.group.basis is not None
    }
    assert rows[False] - rows[True] == (DEFAULT.selection.sectors - 1) * len(names)


def test_upright_surfaces_of_the_map_have_their_own_variance(tmp_path: Path) -> None:
    """The ground of the twin is exact, and each wall is displaced."""
    yard = make_yard(tmp_path, NOISY, known=(NOISE,), frames=8)
    path = yard.drive / "twin/static.glb"
    world = read_glb(path)
    is_of_wall = np.any(world.vertices % 10 != 0, axis=1)  # tiles of the ground have corners at multiples of 10 m
    away = SHIFT_M * np.sign(world.vertices[:, :2]) * (np.abs(world.vertices[:, :2]) > 1)
    moved = world.vertices + np.column_stack([away, np.zeros(len(away))]) * is_of_wall[:, None]
    write_glb(path, replace(world, vertices=moved))
    view = fit_yard(yard)
    level, upright = view.fitter.random.spread(view.fitted.estimate, "map")
    assert level < 0.2 * SHIFT_M
    assert upright == pytest.approx(SHIFT_M, rel=0.5)
    shift_m, _ = edge_tolerance(view.fitter.random, view.fitted.estimate)
    assert shift_m > DEFAULT.random_effects.edge_sigmas * upright


def test_residuals_are_those_of_the_estimate_where_a_variance_became_negligible(tmp_path: Path) -> None:
    """Errors of the ground that are too small for a variance of their own are set to 0, also in the residuals."""
    yard = make_yard(tmp_path, NOISY, known=(NOISE,), frames=8)
    path = yard.drive / "twin/static.glb"
    world = read_glb(path)
    tile = np.arange(len(world.vertices)) // 4
    up = 8e-4 * (-1.0) ** tile * np.all(world.vertices % 10 == 0, axis=1)
    write_glb(path, replace(world, vertices=world.vertices + np.outer(up, (0, 0, 1))))
    view = fit_yard(yard)
    fitted = view.fitted
    assert view.fitter.random.spread(fitted.estimate, "map")[0] == 0
    assert fitted.loglik == pytest.approx(view.fitter.at(fitted.effects, fitted.estimate).loglik, abs=1e-3)


def test_what_all_scans_share_shows_all_the_same(tmp_path: Path) -> None:
    yard = shaken_yard(tmp_path, RangeBias(offset_m=0.02))
    on, by = fit_yard(yard), DEFAULT.selection
    result = next(one for one in _tested(on, yard) if one.group.effect_name == "range_bias")
    assert result.gain > by.confirm_gain
    before = FittedModel(on.frames, on.fitter, on.fitted)
    linearisation = linearise(on.fitter, on.fitted, on.frames)
    after, _ = refit_with(before, linearisation, result.group, result.entry.start, fine=False, steps=10)
    assert 500 * p_of_gain(before, after, result.group, 1.0, by) < 0.05
    fitted = fit_yard(yard, (RangeBias(offset_m=0.0), *NOISY), (0,)).fitted.effects
    assert next(one for one in fitted if isinstance(one, RangeBias)).offset_m == pytest.approx(0.02, rel=0.1)


def _tested(on: FittedFrames, yard: Yard) -> list[GroupTest]:
    context = context_of(opened(yard.drive), yard.sensor)
    model = FittedModel(on.frames, on.fitter, on.fitted)
    groups = effect_groups(linearise(on.fitter, on.fitted, on.frames), context.candidates, (), ())
    return gather_evidence(model, groups, context.settings, 0).results


def test_budget_adds_up_and_separates_poses_from_noise(shaken: Yard) -> None:
    context = context_of(opened(shaken.drive), shaken.sensor)
    effects = context.initial_effects
    budget, _ = budget_of(context, fit_held_out(context, effects), [effects])
    assert sum(budget.parts.values()) == pytest.approx(budget.error, rel=0.02)
    assert budget.parts["poses"] > 0.3 * budget.error
    assert budget.floor is not None and budget.error_aligned < 1.1 * budget.floor < 0.7 * budget.error


def test_darker_surfaces_return_less_often(exact: Yard) -> None:
    """Probabilities and derivatives with albedo errors agree with those of the sensor at other intensities."""
    random = fit_yard(exact).fitter.random
    threshold = DetectionThreshold(threshold=0.2, softness=0.05)
    prediction = random.sample.predict((threshold,))
    variance = np.array([float(name == "albedo_of_map") for name, _ in random.components])
    albedo = random.rows("albedo_of_map")

    def seen_at(error: float) -> np.ndarray:
        u = np.zeros(random.size)
        u[albedo] = error
        return random.adjusted(prediction, Estimate(u, variance)).seen

    error, step = 0.05, 1e-4
    of_map = (random.sample.surface >= 0) & (prediction.seen > 1e-3) & (prediction.seen < 1 - 1e-3)
    logit = ((1 + error) * prediction.intensity - threshold.threshold) / threshold.softness
    assert of_map.sum() > 100
    np.testing.assert_allclose(seen_at(error)[of_map], 1 / (1 + np.exp(-logit[of_map])), atol=1e-3)

    u = np.zeros(random.size)
    u[albedo] = error
    design = random.designs(prediction, Estimate(u, variance))["drop"]
    difference = (seen_at(error + step) - seen_at(error - step)) / (2 * step)
    np.testing.assert_allclose(np.asarray(design.sum(1)).ravel()[of_map], difference[of_map], rtol=1e-3, atol=1e-5)

"""Beams near edges meet either side, or neither: how likely each is, and what the mixture says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate, stats

from assets.mesh import Mesh
from assets.shapes import box
from cosim.discrepancy.analysis import Context, context_of
from cosim.discrepancy.data.checks import opened
from cosim.discrepancy.dictionary.covariates import sample_covariates
from cosim.discrepancy.dictionary.linearisation import linearise
from cosim.discrepancy.inference import likelihood
from cosim.discrepancy.inference.dependence import channel_slopes
from cosim.discrepancy.inference.fit import Fitter
from cosim.discrepancy.inference.likelihood import range_spread_m, residuals_of
from cosim.discrepancy.inference.mixture import mixture_weights
from cosim.discrepancy.inference.score import Evidence
from cosim.discrepancy.sampling.drawing import draw_sample, split_at_edges
from cosim.discrepancy.sampling.sample import Prediction, Sample
from cosim.discrepancy.scores import Ensemble, spurious_ranges
from cosim.discrepancy.settings import DEFAULT
from cosim.drives.twin import read_glb, write_glb
from sensors.effects.points.range_bias import RangeBias
from tests.cosim.discrepancy.small_drive import PATTERN, Yard, make_yard

SHIFT_M, TURN_RAD = 0.15, 5e-3
SHARES = np.array([0.03, 0.02, 0.01, 0.02])  # near a side, less near, anywhere, nowhere


@pytest.fixture(scope="module")
def context(biased_yard: Yard) -> Context:
    return context_of(opened(biased_yard.drive), biased_yard.sensor)


@pytest.fixture(scope="module")
def frames(context: Context):
    return context.tracer.trace_all(context.split.fit, ())


def _sampled(frames, rows: int = 12_000, shift_m: float = SHIFT_M, turn_rad: float = TURN_RAD) -> Sample:
    drawn = draw_sample(frames, rows, np.random.default_rng(1))
    return split_at_edges(frames, drawn, shift_m, turn_rad)


def _expected(context: Context, sample: Sample) -> Prediction:
    """Every beam has some chance of not returning."""
    expected = sample.predict(context.initial_effects)
    seen = np.minimum(expected.seen, 0.9)
    return replace(expected, seen=seen, silent=expected.silent + expected.seen - seen)


def _second(sample: Sample) -> np.ndarray:
    """Rows about another side, one of each beam that has any."""
    rows = np.flatnonzero(~sample.first)
    return rows[np.unique(sample.own[rows], return_index=True)[1]]


@pytest.fixture
def true_shares(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(likelihood, "mixture_weights", lambda *of: SHARES)


def test_chances_of_a_beams_sides_make_one(frames) -> None:
    sample = _sampled(frames)
    assert np.count_nonzero(~sample.first) > 300
    np.testing.assert_allclose(np.bincount(sample.own, sample.chance, len(sample))[sample.first], 1)
    assert sample.chance.min() > 0 and np.all(sample.chance[~sample.first] <= 0.5)
    assert np.array_equal(sample.own[sample.own], sample.own), "beams have one row of their own"


def test_a_frame_without_comparable_beams_has_no_rows(frames) -> None:
    none = replace(frames[0].observed, trusted=np.zeros(len(frames[0].observed.rays), bool))
    sample = _sampled([replace(frames[0], observed=none), frames[1]])
    assert len(sample) > 1000
    assert set(np.unique(sample.frame)) == {1}


def test_probability_of_the_other_side_for_an_edge_between_two_beams(frames) -> None:
    frame, sigma = frames[0], 0.004
    beams = np.flatnonzero(frame.edge & ~frame.grazed)
    side, chance = frame.neighbours.other_sides(frame.shot.hits, beams, 0.0, sigma)
    before, after = frame.neighbours.rows[[0, 1]]
    next_to = (side[:, 0] == before[beams]) | (side[:, 0] == after[beams])
    assert next_to.sum() > 100
    direction = frame.shot.traced.direction
    far = np.linalg.norm(direction[beams] - direction[side[:, 0]], axis=1)[next_to] / sigma
    foreseen = [integrate.quad(stats.norm.sf, 0, one)[0] / one for one in far[:50]]
    np.testing.assert_allclose(chance[next_to, 0][:50], foreseen, rtol=1e-4)


def test_sharp_edges_have_one_side(frames) -> None:
    sample = _sampled(frames, shift_m=0.0, turn_rad=0.0)
    assert sample.first.all() and sample.edge.any()


def test_other_side_of_an_edge_is_the_surface_hit_by_the_neighbouring_beam(context: Context, frames) -> None:
    sample, truth = _sampled(frames), []
    for row in np.flatnonzero(~sample.first)[::7]:
        solid = frames[sample.frame[row]].shot.hits.solid
        around = frames[sample.frame[row]].neighbours.rows[:, sample.beam[row]]
        truth.append(sample.instance[row] in (*solid.instance[around], solid.instance[sample.beam[row]]))
    assert np.mean(truth) > 0.9


@pytest.mark.usefixtures("true_shares")
def test_a_beam_near_an_edge_returns_from_somewhere_or_not_at_all(context: Context, frames) -> None:
    sample = _sampled(frames, 6_000)
    expected = _expected(context, sample)
    sample = replace(sample, intensity=np.zeros(len(sample)), above_m=expected.rise_m)
    sigma, constants = range_spread_m(expected, sample.settings.likelihood), sample.settings.likelihood
    near = np.flatnonzero(sample.first & sample.edge & np.isfinite(expected.range_m))
    other = near.copy()
    other[np.isin(near, sample.own[_second(sample)])] = _second(sample)[np.isin(sample.own[_second(sample)], near)]
    middles = np.stack([expected.range_m[near], np.nan_to_num(expected.range_m[other], nan=1.0)])
    steps = np.sinh(np.linspace(-8, 8, 241))[:, None, None] * sigma[near]
    grid = np.vstack(
        [(middles + steps).reshape(-1, len(near)), np.linspace(0, constants.reach_m, 41)[:, None] + 0 * near]
    )
    grid = np.sort(np.clip(grid, 0, constants.reach_m), axis=0)
    at_once = float(np.exp(likelihood.student(np.zeros(1)))[0])  # of every rise here, which equals its expectation

    def chance(along_m: np.ndarray) -> np.ndarray:
        every = np.full(len(sample), np.nan)
        every[near] = along_m
        return np.exp(residuals_of(replace(sample, along_m=every), expected).loglik[near])

    several = np.bincount(sample.own, minlength=len(sample))[near] > 2
    whole = integrate.trapezoid(np.stack([chance(one) for one in grid]) / at_once, grid, axis=0)
    whole += chance(np.full(len(near), np.nan))
    assert len(near) > 300
    np.testing.assert_allclose(whole[~several], 1, atol=2e-3)


@pytest.mark.usefixtures("true_shares")
def test_scores_of_both_sides_are_slopes_of_the_mixture(context: Context, frames) -> None:
    sample = _sampled(frames)
    expected, step = _expected(context, sample), 1e-6
    score = Evidence.of(sample, residuals_of(sample, expected)).score["range"]
    for rows in (np.flatnonzero(sample.first), _second(sample)):
        aside = np.zeros(len(sample))
        aside[rows] = step
        moved = [replace(expected, range_m=expected.range_m + by) for by in (aside, -aside)]
        up, down = (residuals_of(sample, one).loglik for one in moved)
        slope = (sample.share * (up - down) / (2 * step))[sample.own[rows]]
        assert np.count_nonzero(score[rows]) > 100
        np.testing.assert_allclose(slope, score[rows], rtol=2e-3, atol=2e-3 * np.abs(score[rows]).max())


def test_mixture_weights_maximise_the_likelihood() -> None:
    rng = np.random.default_rng(3)
    sides, weight = rng.exponential(size=2000), rng.uniform(0.5, 2, 2000)
    neither = np.stack([np.where(rng.random(2000) < 0.1, 20.0, 0.05), np.where(rng.random(2000) < 0.05, 10.0, 0.0)])
    share = mixture_weights(sides, neither, weight, DEFAULT.likelihood)

    def loglik(share: np.ndarray) -> float:
        return float(weight @ np.log((1 - share.sum()) * sides + share @ neither))

    for way in (np.array([1e-3, 0]), np.array([0, 1e-3]), np.array([1e-3, -1e-3])):
        assert loglik(share) > max(loglik(share + way), loglik(share - way))


def test_mixture_weights_converge_at_the_limit_of_their_sum() -> None:
    """The maximum is at the limit of the sum of the weights, from which one of two similar components is far."""
    rng, weight = np.random.default_rng(0), np.full(400, 2.0)
    near = rng.uniform(2, 5, 400)
    neither, sides = np.stack([near, near * rng.uniform(0.3, 0.31, 400), np.full(400, 0.008)]), np.full(400, 1e-6)
    share = mixture_weights(sides, neither, weight, DEFAULT.likelihood)
    assert share[0] == pytest.approx(1, abs=1e-3)
    assert share[1:].max() < 1e-4


def test_without_edges_and_with_nothing_but_edges(context: Context, frames) -> None:
    sample = _sampled(frames)
    expected = _expected(context, sample)
    inner = replace(
        sample, edge=np.zeros(len(sample), bool), own=np.arange(len(sample)), first=np.ones(len(sample), bool)
    )
    plain = residuals_of(inner, expected)
    assert np.all(plain.met == 1)
    outer = residuals_of(replace(sample, edge=np.ones(len(sample), bool)), expected)
    assert np.isfinite(outer.loglik).all() and np.all((outer.met >= 0) & (outer.met <= 1))
    assert outer.met[sample.first].mean() < plain.met.mean(), "any beam may have met neither"
    assert np.all(np.bincount(sample.own, outer.met) <= 1 + 1e-9)


def test_neighbours_are_no_covariates_near_edges(context: Context, frames) -> None:
    sample = _sampled(frames)
    found = {one.name: one for one in sample_covariates(sample, _expected(context, sample), tuple(frames))}
    of_neighbours = [one for one in found.values() if one.is_of_neighbour]
    assert {"above_intensity", "previous_range"} <= {one.name for one in of_neighbours}
    for covariate in of_neighbours:
        assert np.all(covariate.index[sample.edge] < 0)
        assert np.any(covariate.index[~sample.edge] >= 0)


def test_unknown_surfaces_are_expected_near_the_sides_of_an_edge(context: Context, frames) -> None:
    """Returns 20 cm behind their side are as likely as their share, not as one at any range."""
    sample = _sampled(frames)
    expected = _expected(context, sample)
    is_aside = sample.edge & sample.first & np.isfinite(sample.range_m) & (sample.beam % 10 == 0)
    aside = replace(sample, along_m=np.where(is_aside, sample.range_m + 0.2, sample.along_m))
    far = replace(sample, along_m=np.where(is_aside, np.abs(sample.range_m - 60), sample.along_m))
    near_loglik, far_loglik = (np.median(residuals_of(one, expected).outcome[is_aside]) for one in (aside, far))
    assert near_loglik > far_loglik + 2


def test_returns_before_both_sides_of_an_edge_are_spurious(context: Context, frames) -> None:
    """A beam that misses both sides goes on behind them: many returns before both are from no surface of the scene."""
    sample = _sampled(frames)
    is_moved = sample.edge & sample.first & (sample.sides_m[0] > 6) & (sample.sides_m[1] < 60) & (sample.beam % 4 == 0)
    outcome, early = {}, {}
    for name, along_m in (("before", 0.5 * sample.sides_m[0]), ("behind", sample.sides_m[1] + 5)):
        moved = replace(
            sample,
            along_m=np.where(is_moved, along_m, sample.along_m),
            surface_nearby=np.where(is_moved, False, sample.surface_nearby),
        )
        fitter = Fitter(moved)
        fitted = fitter.at(context.initial_effects, fitter.random.start())
        outcome[name] = np.median(fitted.residuals.outcome[is_moved])
        score, expected = linearise(fitter, fitted, tuple(frames)).weights("early")
        early[name] = score[is_moved].sum() / expected.sum()
    assert is_moved.sum() > 100
    assert outcome["before"] < outcome["behind"] - 2
    assert early["before"] > 10 and early["behind"] < 0


def test_likelihood_per_beam_near_edges_does_not_depend_on_the_sample_size(context: Context, frames) -> None:
    each = []
    for rows in (6_000, 24_000):
        fitter = Fitter(_sampled(frames, rows))
        without = fitter.fit(context.initial_effects, ())
        biased = fitter.at((*context.initial_effects, RangeBias(offset_m=0.04)), without.estimate)
        share, before, after = fitter.sample.share, without.residuals.loglik, biased.residuals.loglik
        each.append(float(share @ (after - before)) / np.count_nonzero(fitter.sample.first))
    assert each[0] == pytest.approx(each[1], rel=0.1)


def test_other_side_of_an_edge_ignores_the_pane_there(tmp_path: Path) -> None:
    body, cabin = box((4.0, 1.8, 0.8), (0, 0, 0.4), "car_paint"), box((2.0, 1.6, 0.7), (0, 0, 1.15), "car_glass")
    yard = make_yard(tmp_path, car=Mesh.merge([body, cabin]))
    context = context_of(opened(yard.drive), yard.sensor)
    frames = context.tracer.trace_all(context.split.fit, ())
    sample = _sampled(frames, 24_000)
    replays = sample.replay.frames
    assert any(np.isin(frame.shot.hits.pane_beam, sample.beam[~sample.first]).any() for frame in frames)
    for number, replay in enumerate(replays):
        assert sample.first[sample.frame == number][replay.pane_beam].all()
        assert np.isfinite(replay.shot(()).hits.pane.range_m).all()


def test_edges_against_the_sky_are_marked_and_losses_there_are_no_evidence(frames) -> None:
    sample = _sampled(frames)
    misses = np.bincount(sample.own, ~np.isfinite(sample.range_m), len(sample))[sample.own] > 0
    assert np.array_equal(sample.beside_sky, sample.edge & misses)
    assert 0 < sample.beside_sky.sum() < sample.edge.sum()


def test_a_beam_that_always_returns_can_be_lost(context: Context, frames) -> None:
    sample = _sampled(frames)
    expected = replace(_expected(context, sample), seen=np.ones(len(sample)))
    slope = channel_slopes(sample, expected, {}, ["drop"])["drop"]["drop"]
    np.testing.assert_allclose(slope[np.isfinite(expected.range_m)], 1)


def test_beams_that_may_hit_a_thin_rail_between_two_rings_are_ambiguous(tmp_path: Path) -> None:
    """The twin has a rail 3.7 mrad below a ring; the sensor was 4 cm lower and measured it."""
    ahead_m, elevation = 12.0, np.radians(-0.3)

    def onto_rail(points: np.ndarray) -> np.ndarray:
        upward = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
        meets = (
            (np.abs(upward - np.radians(PATTERN.elevation_deg[2])) < 1e-3)
            & (points[:, 0] > ahead_m)
            & (np.abs(points[:, 1] / points[:, 0]) < 0.2)
        )
        scale = np.where(meets, ahead_m / np.maximum(points[:, 0], 1e-3), 1.0)
        return np.column_stack([points[:, :3] * scale[:, None], points[:, 3]]).astype(np.float32)

    yard = make_yard(tmp_path, change=onto_rail)
    path = yard.drive / "twin/static.glb"
    rail = box((0.02, 8.0, 0.01), (ahead_m - 6.0, 0.6, 1.73 + ahead_m * np.tan(elevation)), "wood")
    write_glb(path, Mesh.merge([read_glb(path), rail]))
    context = context_of(opened(yard.drive), yard.sensor)
    frame = context.tracer.trace("000000", ())
    measured = frame.observed.range_from(frame.shot.rays.origin)
    is_of_rail = (frame.shot.rays.ring == 2) & (np.abs(measured - ahead_m) < 0.3)
    assert np.count_nonzero(is_of_rail) > 20
    ambiguous = frame.near_uncertain_edges(SHIFT_M, 0.0)
    assert np.all(ambiguous[is_of_rail])
    assert not np.all(ambiguous[frame.shot.rays.ring == 2])
    # The same for returns of a part of the footprint that a model predicts there.
    solid = frame.shot.hits.solid
    predicted = np.where(is_of_rail, measured, np.where(solid.exists, solid.range_m, np.nan))
    spurious = spurious_ranges(frame, Ensemble(predicted[None], np.zeros((1, len(measured)))))[0]
    assert not np.isfinite(spurious[~is_of_rail]).any()
    fits = frame.fits_nearby(spurious, SHIFT_M, 0.0)
    assert np.mean(fits[is_of_rail]) > 0.9 and not fits[~is_of_rail].any()

"""Losses of beams that nearly always return: gains, significance about the fit, damped steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from cosim.discrepancy.dictionary.covariates import sample_covariates
from cosim.discrepancy.dictionary.effects import effect_groups
from cosim.discrepancy.dictionary.groups import Group, binned_group
from cosim.discrepancy.dictionary.linearisation import Linearisation, linearise
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.random_effects import Estimate
from cosim.discrepancy.inference.score import Evidence
from cosim.discrepancy.selection.choice import _shortlist
from cosim.discrepancy.selection.evidence import gather_evidence
from cosim.discrepancy.selection.refit import FittedModel, Term, refit_with
from cosim.discrepancy.selection.returns import ReturnCounts
from cosim.discrepancy.selection.search import drop_superfluous
from cosim.discrepancy.settings import DEFAULT
from sensors.effects.beams.elevation_offset import ElevationOffset
from sensors.effects.detection.random_dropout import RandomDropout
from sensors.effects.points.range_bias import RangeBias
from sensors.effects.points.range_noise import RangeNoise
from sensors.effects.points.range_walk import RangeWalk
from tests.cosim.discrepancy.small_drive import fit_yard, make_yard

FOLDS = 8


def _counts(share_lost: float, p: float, beams: int = 4000) -> ReturnCounts:
    """One column of beams with the predicted probability p, of which a share is lost in every fold."""
    lost = np.full((FOLDS, 1, 1), beams / FOLDS * share_lost)
    return ReturnCounts(np.array([p]), np.ones(1), beams / FOLDS - lost, lost, 1e-3)


@pytest.mark.parametrize(("share_lost", "p"), [(0.03, 0.999), (0.5, 0.7), (0.1, 0.7)])
def test_gain_is_that_of_the_share_that_is_lost(share_lost: float, p: float) -> None:
    kept = 1 - share_lost
    expected = 4000 * (kept * np.log(kept / p) + share_lost * np.log(share_lost / (1 - p)))
    gain = _counts(share_lost, p).gain()
    assert gain.shape == (FOLDS,)
    assert gain.sum() == pytest.approx(expected, rel=0.05)


def test_beams_that_always_return_gain_nothing_where_none_is_lost() -> None:
    assert _counts(0.0, 0.999).gain().sum() == 0


def test_losses_of_one_fold_only_gain_nothing() -> None:
    lost = np.full((FOLDS, 1, 1), 5.0)
    lost[0] = 35
    counts = ReturnCounts(np.array([0.99]), np.ones(1), 500 - lost, lost, 1e-3)
    assert counts.gain().sum() < 0


def test_damping_shortens_the_step_along_the_direction_that_two_parameters_share() -> None:
    root = np.array([[1.0, 0.999], [1.0, 1.001], [1.0, 1.0]])
    evidence = Evidence({"range": np.array([1.0, -1.0, 0.2])}, {"range": np.ones(3)})
    empty, none = np.zeros(0), np.zeros(0, int)
    model = LinearModel(
        {"range": sparse.csr_matrix(root)}, {}, none, empty, sparse.csr_matrix((0, 0)), none, None, evidence
    )
    plain, _ = model.step(Estimate(empty, empty))
    damped, _ = model.step(Estimate(empty, empty), damping=0.1)
    gradient = root.T @ evidence.score["range"]
    assert np.abs(plain).max() > 100
    assert np.abs(damped).max() < 1
    assert damped @ gradient > 0, "the likelihood rises along the step"


@pytest.fixture(scope="module")
def lossy(tmp_path_factory: pytest.TempPathFactory) -> tuple[FittedModel, Linearisation, Group]:
    """A yard where a tenth of all returns is lost, without this effect; its linearisation; the effect."""
    known = {"effect": "range_noise", "sigma_m": 0.01}
    effects = (RangeNoise(sigma_m=0.01, sigma_per_m=0.0), RandomDropout(probability=0.1))
    on = fit_yard(make_yard(tmp_path_factory.mktemp("lossy"), effects, known=(known,), frames=8))
    linearisation = linearise(on.fitter, on.fitted, on.frames)
    groups = effect_groups(linearisation, [RandomDropout], (), ())
    dropout = next(group for group in groups if group.effect_name == "random_dropout")
    return FittedModel(on.frames, on.fitter, on.fitted), linearisation, dropout


def test_losses_everywhere_are_no_scatter_between_clusters(
    lossy: tuple[FittedModel, Linearisation, Group],
) -> None:
    model, _, dropout = lossy
    evidence = gather_evidence(model, [dropout], DEFAULT, 0)
    result = next(result for result in evidence.results if result.group.effect_name == "random_dropout")
    assert result.gain > 1000, "ten per cent of many thousand beams are lost"


def test_an_effect_is_kept_next_to_bins_that_contain_it(lossy: tuple[FittedModel, Linearisation, Group]) -> None:
    model, linearisation, dropout = lossy
    with_effect, _ = refit_with(model, linearisation, dropout, np.array([0.1]), fine=False, steps=10)
    covariates = sample_covariates(model.fitter.sample, model.fitted.prediction, model.frames)
    material = next(one for one in covariates if one.name == "material")
    bins = binned_group(linearisation, "drop", material, 1)
    assert bins is not None
    both, _ = refit_with(with_effect, linearisation, bins, np.zeros(bins.size), fine=False, steps=10)
    terms = tuple(Term(group, 0.001, 10.0, 10.0) for group in (dropout, bins))
    kept = drop_superfluous(replace(both, terms=terms), (), DEFAULT, set())
    assert [term.group.name for term in kept.terms] == [dropout.name, bins.name]


def test_settings_of_one_effect_do_not_displace_other_effects(
    lossy: tuple[FittedModel, Linearisation, Group],
) -> None:
    model, linearisation, _ = lossy
    groups = effect_groups(linearisation, [RangeWalk, RangeBias, ElevationOffset], (), ())
    evidence = gather_evidence(model, groups, DEFAULT, 0)
    gains = {"range_walk": 100.0, "range_bias": 80.0, "elevation_offset": 70.0}
    results = [result for result in evidence.results if result.group.effect_name in gains]
    ranked = [replace(result, gain=gains[result.group.effect_name]) for result in results]
    assert sum(result.group.effect_name == "range_walk" for result in ranked) >= 4, "one for each decay"
    bins = [replace(result, gain=90.0) for result in evidence.results if not result.group.is_effect]
    shortlist = _shortlist(sorted([*ranked, *bins], key=lambda result: -result.gain), DEFAULT)
    effects = [result.group.effect_name for result in shortlist if result.group.is_effect]
    assert sorted(effects) == sorted(gains)

"""What the gate lets through: effects that objects agree on, and hardly ever chance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from cosim.discrepancy.gate import Direction, Verdict, run_gate
from cosim.discrepancy.inference.clusters import Clusters
from cosim.discrepancy.inference.columns import Column
from cosim.discrepancy.inference.score import Evidence

SCANS, CANDIDATES = 16, 12


def _p_value(effect: float, shared: float, seed: int, objects: int = 18) -> float:
    return _verdict(effect, shared, seed, objects).p_value


def _verdict(effect: float, shared: float, seed: int, objects: int = 18, scans: int = SCANS) -> Verdict:
    """Of intensities on objects of very unequal size, off by an effect and by an error that each object has."""
    rng = np.random.default_rng(seed)
    size = np.rint(400 * rng.exponential(size=objects) ** 2 + 5).astype(int)
    track = np.repeat(np.arange(objects), size)
    scan = rng.integers(scans, size=len(track))
    score = rng.standard_normal(len(track)) + effect + shared * rng.standard_normal(objects)[track]
    every = np.ones(len(track))
    evidence = Evidence({"intensity": score}, {"intensity": every})
    columns = [every, *rng.standard_normal((CANDIDATES - 1, len(track)))]
    found = [Direction(f"{number}", "", "a", Column({"intensity": one})) for number, one in enumerate(columns)]
    no_poses = sparse.csr_matrix((len(track), 6 * SCANS))
    clusters = Clusters(track, scan, scan, sparse.csr_matrix((objects, objects)))
    return run_gate(found, [evidence], [], clusters, (), no_poses, rng)


def test_what_all_objects_agree_on_shows_though_few_of_them_have_most_of_the_beams():
    assert max(_p_value(0.6, 0.1, seed) for seed in range(5)) < 0.05


def test_errors_that_objects_have_of_their_own_hardly_ever_alarm():
    alarms = sum(_p_value(0.0, 0.5, seed) <= 0.05 for seed in range(60))
    assert alarms <= 8  # 3 on average; more than 8 once in 250


@pytest.mark.parametrize("objects", [2, 4])
def test_a_handful_of_objects_proves_nothing(objects):
    assert _p_value(3.0, 0.0, 1, objects) > 0.05


@pytest.mark.parametrize(("objects", "scans", "claims"), [(18, SCANS, True), (4, SCANS, False), (18, 1, False)])
def test_of_few_objects_or_scans_nothing_is_claimed(objects, scans, claims):
    verdict = _verdict(0.0, 0.0, 0, objects, scans)
    assert {bool(np.isfinite(one.smallest)) for one in verdict.statistics} == {claims}
    silenced = verdict.unclaimed({"0", "1"})
    assert {one.direction.effect for one in silenced.statistics if np.isfinite(one.smallest)} == (
        {f"{number}" for number in range(2, CANDIDATES)} if claims else set()
    )


@pytest.mark.parametrize("rises_tell", [True, False])
def test_a_constant_error_is_none_of_the_lasers_where_their_rises_say_so(rises_tell):
    rng, rings, objects, beams = np.random.default_rng(0), 8, 30, 6000
    track, scan, ring = (rng.integers(many, size=beams) for many in (objects, SCANS, rings))
    every = np.ones(beams)
    score = {"range": rng.standard_normal(beams) + 0.5, "rise": rng.standard_normal(beams)}
    evidence = Evidence(score, {"range": every, "rise": every})  # pyright: ignore[reportArgumentType]
    of_lasers = Column({"range": every, "rise": 20 * every} if rises_tell else {"range": every}, ring, rings)
    clusters = Clusters(track, scan, scan, sparse.csr_matrix((objects, objects)))
    found = [Direction("offset", "", "a", Column({"range": every}))]
    no_poses = sparse.csr_matrix((beams, 0))
    verdict = run_gate(found, [evidence], [evidence], clusters, (of_lasers,), no_poses, rng)
    assert (verdict.p_value <= 0.05) == rises_tell

"""Edges of labels lose a + b·d: found with its parameters; noisy annotations are not a bias."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.labels.bias import Certainty, LabelFinding, _test_bias
from cosim.labels.bodies import LabelRows


def rows(rng: np.random.Generator, a: float, b: float, mood_m: float, tracks: int = 30, each: int = 6) -> LabelRows:
    """Labels of some vehicles, each labelled several times with a mood of its own."""
    track = np.repeat(np.arange(tracks), each)
    gap = rng.uniform(0, 1.5, (len(track), 3))
    mood = rng.normal(0, mood_m, (tracks, 3))[track]
    loss = a + b * gap + mood + rng.normal(0, 0.01, gap.shape)
    return LabelRows(track, loss, gap, np.full(len(track), 0.5), 0.04 + 0.5 * (a + b * gap[:, 2]))


def diagnosed(seed: int, a: float, b: float, mood_m: float, by: Certainty | None = None) -> LabelFinding:
    drawn = rows(np.random.default_rng(seed), a, b, mood_m)
    return _test_bias(drawn, None, by or Certainty(), np.random.default_rng(seed))


def test_the_equation_is_detected() -> None:
    found = diagnosed(1, 0.15, 0.2, 0.03)
    assert found.verdict == "missing"
    assert found.a_m == pytest.approx((0.15,) * 3, abs=0.03)
    assert found.b == pytest.approx((0.2,) * 3, abs=0.03)
    assert found.lift_m == pytest.approx(0.04, abs=0.02)
    assert found.error_after < found.error_before


def test_wavering_annotators_seldom_alarm() -> None:
    verdicts = [diagnosed(seed, 0.0, 0.0, 0.05).verdict for seed in range(40)]
    assert verdicts.count("missing") <= 5


def test_the_significance_level_can_be_set() -> None:
    usual = diagnosed(1, 0.15, 0.2, 0.03)
    surer = diagnosed(1, 0.15, 0.2, 0.03, Certainty(coverage=0.99, power=1.28))
    assert usual.ci95 is not None
    assert surer.ci95 is not None
    assert np.all(np.ptp(surer.ci95["a_m"], axis=1) > np.ptp(usual.ci95["a_m"], axis=1))
    assert np.all(np.array(surer.smallest_m) > usual.smallest_m), "to be seen with 90 % power takes more"
    assert diagnosed(1, 0.15, 0.2, 0.03, Certainty(level=usual.p_value / 2)).verdict == "none"

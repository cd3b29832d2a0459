"""Expected information of drives: a path gives no information on what it does not vary."""

from __future__ import annotations

import numpy as np

from cosim.recordings.calibration.advice import Advice, advise, undetermined
from cosim.recordings.calibration.manoeuvres import candidates, same_path, standard_errors
from sensors.effects.points.range_noise import RangeNoise
from sensors.pattern import load_pattern

PATTERN = load_pattern("vlp16").model_copy(update={"firings": 90})
EFFECTS = (RangeNoise(sigma_m=0.02, sigma_per_m=0.0),)
SWEEP = ("sweep_motion", "sweep_s")


def standing() -> np.ndarray:
    return np.tile(np.eye(4), (36, 1, 1))


def test_a_stationary_sensor_does_not_determine_its_motion_in_a_sweep() -> None:
    found = standard_errors(same_path(standing(), 1.8), PATTERN, EFFECTS, ["sweep_motion"])
    assert np.isinf(found[SWEEP])


def test_turning_determines_the_motion_in_a_sweep_better_than_driving_straight() -> None:
    drives = {one.words: one for one in candidates(1.8, PATTERN.sweep_s)}
    straight, circle = (
        standard_errors(next(one for words, one in drives.items() if part in words), PATTERN, EFFECTS, ["sweep_motion"])
        for part in ("one speed", "circle")
    )
    assert 0 < circle[SWEEP] < 0.5 * straight[SWEEP] < np.inf


def test_advice_names_a_drive_for_what_is_undetermined() -> None:
    rows = undetermined({"sweep_motion": {"sweep_s": None}, "range_scale": {"scale_ppm": None}}, {})
    assert rows == {SWEEP: None, ("range_scale", "scale_ppm"): None}
    sweep, scale = advise(rows, standing(), 1.8, PATTERN, EFFECTS)
    assert sweep.drive and "no information on it" in sweep.words
    assert not scale.drive and "surveyed map" in scale.words


def test_a_wide_interval_is_undetermined_and_a_narrow_one_is_not() -> None:
    found = {"sweep_motion": {"params": {"sweep_s": 0.1}, "ci95": {"sweep_s": [0.02, 0.18]}}}
    assert SWEEP in undetermined({}, found)
    found["sweep_motion"]["ci95"]["sweep_s"] = [0.098, 0.102]
    assert not undetermined({}, found)
    assert "2.5 times narrower" in Advice(*SWEEP, 0.08, "s", "turn", 2.5).words

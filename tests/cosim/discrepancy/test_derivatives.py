"""Derivatives of predictions with respect to effects' parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.discrepancy.candidates import unknowns
from cosim.discrepancy.inference.derivatives import difference_quotients
from sensors.effects.beams.elevation_offset import ElevationOffset
from tests.cosim.discrepancy.small_drive import fit_yard, make_yard


def test_range_of_level_ground_changes_with_elevation_as_its_equation_says(tmp_path) -> None:
    """R = h/sin ε for a depression ε, hence dR/dε = −R/tan ε, also where the incidence is grazing."""
    sample = fit_yard(make_yard(tmp_path)).fitter.sample
    effects = (ElevationOffset(offset_deg=0.0),)
    at = sample.predict(effects)
    (unknown,) = unknowns(ElevationOffset)
    slope = difference_quotients(sample, effects, 0, unknown, unknown.step, at)["range"]
    down = np.radians(-sample.elevation_deg)
    height = at.range_m * np.sin(down)
    level = (down > np.radians(0.5)) & (np.abs(height - np.nanmedian(height)) < 0.01)
    level &= sample.facing == np.bincount(sample.facing[level]).argmax()  # no walls
    assert level.sum() > 200
    expected = np.radians(at.range_m / np.tan(down))
    np.testing.assert_allclose(slope[level], expected[level], rtol=1e-3)
    assert np.degrees(down[level]).min() < 2.5


def test_a_jump_to_one_side_is_no_slope_of_the_range(tmp_path) -> None:
    sample = fit_yard(make_yard(tmp_path)).fitter.sample
    effects = (ElevationOffset(offset_deg=0.0),)
    (unknown,) = unknowns(ElevationOffset)
    at = sample.predict(effects)
    jump = at.range_m.copy()
    jump[0] += 50.0  # the prediction at the value itself lies beside those of both sides
    slope = difference_quotients(sample, effects, 0, unknown, unknown.step, replace(at, range_m=jump))["range"]
    assert slope[0] == 0

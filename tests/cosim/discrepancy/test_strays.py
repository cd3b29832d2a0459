"""Spurious returns: sectors with many of them, and uncertainty of their density."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cosim.discrepancy import Diagnosis, diagnose
from cosim.discrepancy.inference.search import crowded_sector, interval_widening
from sensors.effects.base import Effect
from sensors.effects.points.range_noise import RangeNoise
from sensors.effects.scans.backscatter import Backscatter
from sensors.effects.scans.false_alarms import FalseAlarms
from tests.cosim.discrepancy.conftest import NOISE
from tests.cosim.discrepancy.small_drive import make_yard


def _spurious(middle_deg: float, width_deg: float, rng: np.random.Generator) -> tuple[Any, Any]:
    azimuth = np.radians(np.linspace(-179.9, 179.9, 40_000))
    apart = np.abs((np.degrees(azimuth) - middle_deg + 180) % 360 - 180)
    chance = np.where(apart <= width_deg / 2, 0.08, 0.002)
    spurious_per_m = rng.random(len(azimuth)) < chance
    every = np.ones(len(azimuth))
    sample = SimpleNamespace(azimuth=azimuth, returned=every > 0, clear=every > 0, weight=every)
    return cast(Any, sample), cast(Any, SimpleNamespace(matched=1.0 - spurious_per_m))


@pytest.mark.parametrize(("middle", "width"), [(40.0, 50.0), (175.0, 30.0), (-90.0, 120.0)])
def test_sector_of_spurious_returns_is_detected_also_across_the_seam(middle, width):
    found = crowded_sector(*_spurious(middle, width, np.random.default_rng(5)))
    assert abs((found["azimuth_deg"] - middle + 180) % 360 - 180) < 1
    assert found["width_deg"] == pytest.approx(width, abs=1.5)


@pytest.mark.parametrize("coupling", [0.0, -0.6, 0.9])
def test_parameters_that_compensate_each_other_are_less_certain(coupling):
    """Of a paraboloid ½(x² + y² + 2ρxy), x is known to 1 with y held and to 1/√(1 − ρ²) with y free."""
    start = Backscatter(density_per_m=0.01, mean_range_m=10.0)
    unit = {"density_per_m": 1e-4, "mean_range_m": 0.1}

    def lost(effects):
        x, y = ((getattr(effects[0], name) - getattr(start, name)) / step for name, step in unit.items())
        return 0.5 * (x**2 + y**2 + 2 * coupling * x * y)

    held = {name: (getattr(start, name) - step, getattr(start, name) + step) for name, step in unit.items()}
    wider = interval_widening((start,), 0, held, lost)
    for by in wider.values():
        assert by == pytest.approx(1 / np.sqrt(1 - coupling**2), rel=1e-3)


def _diagnosed(folder: Path, *hidden: Effect) -> Diagnosis:
    yard = make_yard(folder, (RangeNoise(sigma_m=0.01, sigma_per_m=0.0), *hidden), known=(NOISE,), frames=16)
    return diagnose(yard.drive, yard.sensor)


@pytest.mark.slow
def test_few_false_alarms_per_scan_are_detected_and_fewer_are_not_reported(tmp_path: Path):
    least = _diagnosed(tmp_path / "none").smallest_detectable["false_alarms"]["rate_per_frame"]
    assert 2 < least < 8
    for times in (1.5, 4.0):
        truth = FalseAlarms(rate_per_frame=times * least, azimuth_deg=60.0, width_deg=60.0)
        found = _diagnosed(tmp_path / f"{times}", truth)
        assert [one.effect for one in found.effects] == ["false_alarms"]
        params, (low, high) = found.effects[0].params, found.effects[0].ci95["rate_per_frame"]
        assert low < truth.rate_per_frame < high
        assert params["azimuth_deg"] == pytest.approx(60, abs=8)
        assert params["width_deg"] == pytest.approx(60, abs=16)


@pytest.mark.slow
def test_thin_fog_is_identified_by_its_range(tmp_path: Path):
    truth = Backscatter(density_per_m=4e-4, mean_range_m=6.0)
    found = _diagnosed(tmp_path, truth)
    assert [one.effect for one in found.effects] == ["backscatter"]
    for name, value in truth.model_dump().items():
        low, high = found.effects[0].ci95[name]
        assert low < value < high
        assert high - low < value

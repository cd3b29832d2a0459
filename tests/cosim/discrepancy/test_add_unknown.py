"""`cosim add` fits unknown effects of every kind, and the error falls."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.cli.main import main
from cosim.discrepancy.unknown.curve import Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import effect_of
from cosim.discrepancy.unknown.source import effect_source
from sensors.effects.points.intensity_noise import IntensityNoise
from sensors.effects.points.range_noise import RangeNoise
from tests.cosim.discrepancy.small_drive import make_yard

AZIMUTH = np.linspace(-np.pi, np.pi, 41)[:-1] + np.pi / 40
RANGE_M = np.linspace(3, 40, 30)
INCIDENCE_DEG = np.linspace(0, 85, 30)
ELEVATION_DEG = np.linspace(-22, 2, 24)
TURN = 2 * np.pi


def over(channel: str, covariate: str, unit: str, x: np.ndarray, y: np.ndarray, period: float = 0.0) -> Curve:
    return Curve(channel, (covariate,), (unit,), (x,), y, np.full(len(x), 1e-3 * np.ptp(y)), (period,))


_BELL = np.exp(-(((AZIMUTH - 0.5) / 0.5) ** 2))
_FALL = np.exp(-(RANGE_M - 3) / 15)
QUICK = [
    over("range", "incidence", "deg", INCIDENCE_DEG, 1e-3 * INCIDENCE_DEG),
    over("drop", "range", "m", RANGE_M, -0.012 * RANGE_M),
]
SLOW = [
    over("intensity", "azimuth", "rad", AZIMUTH, -0.5 * _BELL, TURN),
    over("intensity_offset", "range", "m", RANGE_M, 4e-3 * RANGE_M),
    over("elevation_error", "range", "m", RANGE_M, 3e-3 * _FALL),
    over("azimuth_error", "azimuth", "rad", AZIMUTH, 4e-3 * np.sin(2 * AZIMUTH + 0.5), TURN),
    over("early", "azimuth", "rad", AZIMUTH, 0.05 * (AZIMUTH > 0.6), TURN),
    over("late", "elevation", "deg", ELEVATION_DEG, 0.03 + 1e-3 * ELEVATION_DEG),
    Curve("spurious", ("constant",), ("",), (np.zeros(1),), np.array([0.02]), np.array([1e-3])),
    over("range_variance", "range", "m", RANGE_M, 0.03 * RANGE_M),
    Curve("shared_range", ("firing",), ("",), (("firing",),), np.array([0.04]), np.array([1e-3])),
    Curve("shared_elevation_error", ("firing",), ("",), (("firing",),), np.array([2e-3]), np.array([1e-4])),
    Curve(
        "elevation_error", ("time",), ("s",), (("cosine", "sine"),), np.array([2e-3, 1e-3]), np.full(2, 1e-5),
        frequency_hz=17.3,
    ),
    Curve("drop", ("previous_lost",), ("",), (("seen", "lost"),), np.array([-0.05, -0.6]), np.full(2, 1e-3)),
    Curve("range", ("scan",), ("s",), (np.arange(5.0),), np.array([0.03, -0.03, 0.01, -0.02, 0.02]), np.full(5, 1e-3)),
    Curve(
        "range", ("ring", "range"), ("", "m"), (tuple(map(str, range(24))), RANGE_M[::3]),
        np.outer(0.05 * np.sin(np.arange(24)), np.linspace(0.3, 1, 10)), np.full((24, 10), 1e-3),
    ),
]  # fmt: skip
KNOWN = ({"effect": "range_noise", "sigma_m": 0.01}, {"effect": "intensity_noise", "sigma_rel": 0.05})


def check_add(curve: Curve, folder: Path) -> None:
    unknown = UnknownEffect.of(curve)
    true = effect_of(unknown)
    effects = (true, RangeNoise(sigma_m=0.01), IntensityNoise(sigma_rel=0.05))
    yard = make_yard(folder, effects, known=KNOWN, frames=5)
    plug_in = folder / f"{unknown.name}.py"
    plug_in.write_text(effect_source(unknown), encoding="utf-8")
    arguments = ["add", f"{plug_in}:{unknown.class_name}", "--sensor", str(yard.sensor), "--drive", str(yard.drive)]
    out = folder / "with.yaml"
    assert main([*arguments, "--out", str(out), "--json", str(folder / "add.json"), "--quiet"]) == 0
    found = json.loads((folder / "add.json").read_text())
    assert found["error_after"] < 0.97 * found["error_before"]
    for name in ("amplitude", "sigma", "cosine", "sine"):
        if name in found["params"]:
            assert found["params"][name] == pytest.approx(true.model_dump()[name], rel=0.2)
    assert f"./{unknown.name}.py:{unknown.class_name}" in out.read_text()


@pytest.mark.parametrize("curve", QUICK, ids=lambda curve: curve.name)
def test_add_fits_an_unknown_effect_and_the_error_falls(curve: Curve, tmp_path: Path) -> None:
    check_add(curve, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("curve", SLOW, ids=lambda curve: curve.name)
def test_add_fits_unknown_effects_of_all_channels(curve: Curve, tmp_path: Path) -> None:
    check_add(curve, tmp_path)

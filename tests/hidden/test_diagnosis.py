"""Hidden physics is found in a small drive, and nothing where nothing is hidden."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.hidden.drive import Hidden, Made, make_drive

_SMALL = Hidden(firings=500, every_ring=2, frames=8)


def _diagnosed(made: Made) -> dict:
    from cosim.discrepancy import diagnose

    return diagnose(made.drive, made.sensor).to_json()


@pytest.mark.slow
def test_nothing_hidden_nothing_reported(base: Path, tmp_path: Path) -> None:
    found = _diagnosed(make_drive(base, tmp_path / "drive", replace(_SMALL, seed=11)))
    assert found["verdict"] == "none"
    assert found["effects"] == []
    assert found["smallest_detectable"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "parameters"),
    [("range_walk", {"amplitude_m": 0.15, "decay": 4.0}), ("incidence_falloff", {"exponent": 0.8})],
)
def test_a_strong_effect_is_named(base: Path, tmp_path: Path, effect: str, parameters: dict) -> None:
    hidden = replace(_SMALL, effects={effect: parameters}, seed=12)
    found = _diagnosed(make_drive(base, tmp_path / "drive", hidden))
    assert found["effects"][0]["effect"] == effect
    for name, true in parameters.items():
        assert found["effects"][0]["params"][name] == pytest.approx(true, rel=0.15)
    assert found["error_after"] < found["error_before"]


def test_compare_of_the_true_sensor_is_at_the_floor(base: Path, tmp_path: Path) -> None:
    from cosim.discrepancy import compare
    from tests.hidden.floor import noise_floor

    hidden = replace(_SMALL, seed=13, frames=2)
    made = make_drive(base, tmp_path / "drive", hidden)
    assert compare(made.drive, made.sensor).error == pytest.approx(
        noise_floor(hidden.truth, made.drive, [0, 1]).error, rel=0.03
    )

"""A yard measured by a sensor with a range error that is missing in the user's file."""

from __future__ import annotations

from pathlib import Path

import pytest

from sensors.effects.registry import find_effect
from tests.cosim.discrepancy.small_drive import Yard, make_yard

NOISE = {"effect": "range_noise", "sigma_m": 0.01}


@pytest.fixture(scope="session")
def biased_yard(tmp_path_factory: pytest.TempPathFactory) -> Yard:
    """Eight frames: 4 cm too far, and noise that the file knows."""
    effects = (
        find_effect("range_bias").model_validate({"offset_m": 0.04}),
        find_effect("range_noise").model_validate({"sigma_m": 0.01}),
    )
    folder: Path = tmp_path_factory.mktemp("yard")
    return make_yard(folder, effects, known=(NOISE,), frames=8)

"""Steps of fitted parameters."""

import numpy as np
import pytest

from cosim.discrepancy.inference.parameters import all_free, apply_step
from sensors.effects.beams.encoder_eccentricity import EncoderEccentricity


@pytest.mark.parametrize(("start_deg", "step_deg", "end_deg"), [(170, 20, -170), (-350, 1, 11), (50, -200, -150)])
def test_a_phase_stays_within_half_a_turn(start_deg: float, step_deg: float, end_deg: float) -> None:
    """It neither stops at the bounds that a file may contain, nor is reported as −310° for 50°."""
    effects = (EncoderEccentricity(amplitude_deg=0.3, phase_deg=start_deg),)
    free = all_free(effects, (0,), rings=64)
    (moved,) = apply_step(effects, free, np.array([0.1, step_deg]))
    assert moved.model_dump() == pytest.approx({"amplitude_deg": 0.4, "phase_deg": end_deg})

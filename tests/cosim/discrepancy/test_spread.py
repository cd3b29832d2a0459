"""How wide noise is, is told whatever law it follows."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.discrepancy.inference.intervals import intervals
from sensors.effects.range_noise import RangeNoise
from tests.cosim.discrepancy.small_drive import make_yard, viewed_yard

SIGMA_M = 0.03
LAWS = {
    "Gauss": lambda rng, size: rng.standard_normal(size),
    "Laplace": lambda rng, size: rng.laplace(0, np.sqrt(0.5), size),
    "two humps": lambda rng, size: np.sign(rng.standard_normal(size)) * 0.9 + 0.436 * rng.standard_normal(size),
}


@pytest.mark.parametrize("law", LAWS)
def test_its_standard_deviation_is_found(law: str, tmp_path) -> None:
    rng = np.random.default_rng(5)

    def noisy(points: np.ndarray) -> np.ndarray:
        ranges = np.linalg.norm(points[:, :3], axis=1, keepdims=True)
        off = SIGMA_M * LAWS[law](rng, ranges.shape)
        return np.column_stack([points[:, :3] * (1 + off / ranges), points[:, 3]]).astype(np.float32)

    yard = make_yard(tmp_path, frames=2, change=noisy, known=({"effect": "range_noise", "sigma_m": 0.05},))
    wrong = RangeNoise(sigma_m=0.05)
    view = viewed_yard(yard, (wrong,), free=(0,))
    found = view.fitted.effects[0]
    assert isinstance(found, RangeNoise)
    assert found.sigma_m == pytest.approx(SIGMA_M, rel=0.03)
    low, high = intervals(view.fitter, view.fitted)["range_noise"]["sigma_m"]
    assert low <= SIGMA_M <= high

"""A tilted scanner meets the plane of the road where geometry says, near and far."""

import numpy as np
import pytest

from cosim.discrepancy.inference.pose_errors import PoseErrors

_HEIGHT_M = 1.73


def _road(reach_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How ranges of beams that meet a level road ahead change, and how far down these look."""
    down = np.arcsin(_HEIGHT_M / reach_m)
    ray = np.stack([np.cos(down), np.zeros_like(down), -np.sin(down)], 1)
    slope = ray[:, 2:3]
    normal = np.tile([0.0, 0.0, 1.0], (len(down), 1))
    turned = normal / slope
    return np.hstack([-turned, -np.cross(ray, turned) * reach_m[:, None]]), down


def _errors(derivative: np.ndarray, reach_m: np.ndarray) -> PoseErrors:
    return PoseErrors(derivative, np.zeros(len(reach_m), int), reach_m, 1)


def _pitched(degrees: float) -> np.ndarray:
    return np.array([[0, 0, 0, 0, np.radians(degrees), 0]])


@pytest.mark.parametrize("degrees", [-0.2, 0.05, 0.2])
def test_a_pitched_scanner_meets_the_road_where_its_beams_look(degrees: float) -> None:
    reach = np.array([5.0, 20.0, 50.0])
    derivative, down = _road(reach)
    expected = _HEIGHT_M / np.sin(down + np.radians(degrees)) - reach
    found = _errors(derivative, reach).shift(_pitched(degrees))
    np.testing.assert_allclose(found, expected, rtol=2e-3)


@pytest.mark.parametrize("bent_deg", [0.0, 0.3])
def test_slopes_are_those_of_the_shift(bent_deg: float) -> None:
    reach = np.array([5.0, 20.0, 50.0])
    derivative, down = _road(reach)
    errors, bent = _errors(derivative, reach), _HEIGHT_M / np.sin(down + np.radians(bent_deg))
    pose, step = np.array([[0.05, 0.02, -0.03, 0.001, 0.002, -0.001]]), 1e-6
    slopes = errors.slopes(pose, bent).toarray()
    for axis in range(6):
        aside = pose.copy()
        aside[0, axis] += step
        change = (errors.shift(aside, bent) - errors.shift(pose, bent)) / step
        np.testing.assert_allclose(change, slopes[:, axis], rtol=1e-4)


@pytest.mark.parametrize("bent_deg", [-0.1, 0.3])
def test_pose_error_cancels_a_rotation_by_an_effect(bent_deg: float) -> None:
    reach = np.array([5.0, 20.0, 50.0, 100.0])
    derivative, down = _road(reach)
    bent = _HEIGHT_M / np.sin(down + np.radians(bent_deg))
    back = bent + _errors(derivative, reach).shift(_pitched(-bent_deg), bent)
    np.testing.assert_allclose(back, reach, rtol=1e-4)


def test_a_beam_that_meets_nothing_is_not_moved() -> None:
    derivative, _ = _road(np.array([5.0, 20.0]))
    derivative[1] = 0
    errors = _errors(derivative, np.array([5.0, np.nan]))
    assert errors.shift(_pitched(0.1))[1] == 0
    assert not errors.slopes(_pitched(0.1)).toarray()[1].any()


@pytest.mark.parametrize("bent_deg", [0.0, 0.3])
def test_range_derivative_with_a_pose_error_equals_finite_differences(bent_deg: float) -> None:
    reach = np.array([5.0, 20.0, 50.0])
    derivative, down = _road(reach)
    errors, bent = _errors(derivative, reach), _HEIGHT_M / np.sin(down + np.radians(bent_deg))
    pose, step = np.array([[0.05, 0.02, -0.03, 0.001, 0.002, -0.001]]), 1e-5
    ahead, behind = (bent + side + errors.shift(pose, bent + side) for side in (step, -step))
    np.testing.assert_allclose((ahead - behind) / (2 * step), errors.range_derivative(pose, bent), rtol=1e-6)

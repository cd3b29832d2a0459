"""Normals of small planes: from their neighbours on a larger plane, not across its edges."""

from __future__ import annotations

import numpy as np

from cosim.recordings.mapping.normals import steadied

CELL_M = 0.4


def _cells(height: np.ndarray, rng: np.random.Generator, error_deg: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """Centres of cells on a grid with heights (n, n), and level normals with errors."""
    n = len(height)
    x, y = np.meshgrid(np.arange(n) * CELL_M, np.arange(n) * CELL_M, indexing="ij")
    centre = np.stack([x.ravel(), y.ravel(), height.ravel() + rng.normal(0, 0.002, n * n)], 1)
    normal = np.concatenate([rng.normal(0, np.radians(error_deg), (n * n, 2)), np.ones((n * n, 1))], 1)
    return centre, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def _tilt_deg(normal: np.ndarray, true: np.ndarray) -> np.ndarray:
    return np.degrees(np.arccos(np.clip(normal @ true, -1, 1)))


def _steadied(centre: np.ndarray, normal: np.ndarray) -> np.ndarray:
    count = len(centre)
    return steadied(centre, normal, np.full(count, 40), np.full(count, 0.02), CELL_M)


def test_normals_of_a_plane_are_ten_times_more_exact() -> None:
    rng = np.random.default_rng(0)
    slope = 0.05 * np.arange(20)[:, None] * CELL_M * np.ones((1, 20))
    centre, normal = _cells(slope, rng)
    true = np.array([-0.05, 0.0, 1.0]) / np.hypot(1, 0.05)
    assert np.median(_tilt_deg(_steadied(centre, normal), true)) < 0.2 < np.median(_tilt_deg(normal, true)) / 5


def test_a_kerb_does_not_tilt_its_neighbours() -> None:
    rng = np.random.default_rng(1)
    height = np.where(np.arange(20) < 10, 0.0, 0.12)[:, None] * np.ones((1, 20))
    centre, normal = _cells(height, rng)
    up = np.array([0.0, 0.0, 1.0])
    own, tilt = (_tilt_deg(one, up).reshape(20, 20) for one in (normal, _steadied(centre, normal)))
    assert np.median(tilt) < 0.2 and np.quantile(tilt[8:12], 0.9) < np.quantile(own[8:12], 0.9)
    assert np.median(tilt[8:12]) < 0.5


def test_surfaces_that_are_not_flat_keep_their_normals() -> None:
    rng = np.random.default_rng(2)
    centre, normal = _cells(rng.normal(0, 0.1, (12, 12)), rng)
    np.testing.assert_array_equal(_steadied(centre, normal), normal)


def test_normals_point_to_the_side_of_the_majority() -> None:
    rng = np.random.default_rng(3)
    centre, normal = _cells(np.zeros((12, 12)), rng)
    normal[::10] *= -1
    assert (_steadied(centre, normal)[:, 2] > 0).all()


def test_few_planes_keep_their_normals() -> None:
    centre, normal = _cells(np.zeros((2, 2)), np.random.default_rng(4))
    np.testing.assert_array_equal(_steadied(centre, normal), normal)

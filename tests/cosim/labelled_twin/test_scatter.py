"""A twin made from labels knows how far it may be off: as far as points scatter about it."""

from __future__ import annotations

import numpy as np
import pytest

from assets import CATALOGUE, build_model
from cosim.drives.twin import Instance, Trust
from cosim.labelled_twin.ground_surface import fit_ground
from cosim.labelled_twin.road_cells import find_road_cells
from cosim.labelled_twin.scatter import body_scatter, ground_scatter

from .scans import HEIGHT_M, scan

CAR = next(name for name, spec in CATALOGUE.items() if spec.kind == "car")


def rough(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Even ground to the right; to the left bumps of 2 cm, too short for the surface to follow."""
    bumps = np.sin(2 * np.pi * x / 1.1) * np.sin(2 * np.pi * y / 1.3)
    return -HEIGHT_M + 0.04 * bumps * (y > 0)


def car(scale: np.ndarray) -> Instance:
    pose = np.eye(4)
    pose[:3, 3] = 8, -3, 0
    length, width, height = np.array(CATALOGUE[CAR].size_m) * scale
    return Instance("car0", "car", CAR, pose, np.zeros(3), 0.0, length, width, height, scale, 0.5)


def on_its_surface(instance: Instance, count: int, rng: np.random.Generator) -> np.ndarray:
    corners = build_model(CAR).triangles[rng.integers(0, len(build_model(CAR).faces), count)]
    share = rng.dirichlet(np.ones(3), count)
    return np.einsum("nk,nkj->nj", share, corners) * instance.scale + instance.pose[:3, 3]


def test_rough_ground_is_less_certain_than_even_ground() -> None:
    points, ring = scan(rough)
    surface, cells = fit_ground(find_road_cells(points, ring, np.zeros(len(ring), bool), 35.0)) or pytest.fail("none")
    left, right = (ground_scatter(cells, surface, np.array([[6.0, side]]))[0] for side in (4.0, -4.0))
    assert right < 0.01 < 0.012 < left < 0.03


@pytest.mark.parametrize("off_m", [0.05, 0.1])
def test_bodies_are_as_uncertain_as_points_differ_from_their_models(off_m: float) -> None:
    rng, instance = np.random.default_rng(0), car(np.array([1.1, 1.0, 1.2]))
    exact = on_its_surface(instance, 4000, rng)
    assert body_scatter([instance], exact)[0] < 0.03
    away = body_scatter([instance], exact + rng.normal(0, off_m, exact.shape))[0]
    assert away == pytest.approx(off_m, rel=0.3)


def test_unseen_parts_have_their_true_size() -> None:
    assert body_scatter([car(np.ones(3))], np.zeros((0, 3)))[0] == pytest.approx(0.15)


def test_beams_are_as_uncertain_as_what_they_meet() -> None:
    ground, sd = np.ones((2, 1), bool), np.array([[0.01], [0.02]], np.float32)
    bodies = np.array([0.1], np.float32), np.array([0.3], np.float32)
    trust = Trust(np.zeros(2), 0.5, ground, np.zeros((2, 1), np.float32), True, 0.0, 6.0, sd, 0.2, *bodies)
    met = np.array([[0.2, 0.2, 0], [0.7, 0.2, 0], [0.2, 0.2, 1], [9, 9, 0], [np.nan] * 3])
    away, bright = trust.sigmas(met, np.array([-1, -1, 0, -1, -2]))
    assert away == pytest.approx([0.01, 0.02, 0.1, 0, 0])
    assert bright == pytest.approx([0.2, 0.2, 0.3, 0, 0])

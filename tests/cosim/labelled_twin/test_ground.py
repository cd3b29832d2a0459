"""The fitted ground is the world's: it follows roads, stops at kerbs and leaves the sensor's errors in the points."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.labelled_twin.ground_surface import GroundSurface, fit_ground
from cosim.labelled_twin.road_cells import RoadCells, find_road_cells
from cosim.labelled_twin.trusted_ground import ground_mesh, trust_ground
from sensors.bvh import Bvh

from .scans import HEIGHT_M, Block, Ground, flat, scan

SENSOR = np.array([-0.5, 0.0, HEIGHT_M])


def crowned(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """2 % to both sides, 3 % uphill, kerbs of 12 cm at |y| = 5 m."""
    return -HEIGHT_M - 0.02 * np.sqrt(y**2 + 0.25) + 0.03 * x + 0.12 * (np.abs(y) > 5)


def waved(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Waves of 3 cm, 12 m long."""
    return -HEIGHT_M + 0.03 * np.sin(2 * np.pi * x / 12) * np.cos(2 * np.pi * y / 12)


def fitted(ground: Ground, **options) -> tuple[GroundSurface, RoadCells]:
    points, ring = scan(ground, **options)
    found = fit_ground(find_road_cells(points, ring, np.zeros(len(points), bool), 35.0))
    assert found is not None
    return found


@pytest.mark.parametrize("error_deg", [-0.3, 0.0, 0.1, 0.2])
@pytest.mark.parametrize("ground", [flat, crowned])
def test_an_elevation_error_stays_in_the_points_and_out_of_the_surface(ground: Ground, error_deg: float) -> None:
    surface, cells = fitted(ground, error_deg=error_deg)
    assert surface.knows_cone
    assert np.degrees(surface.cone_rad) == pytest.approx(error_deg, abs=0.015)
    xy = cells.xyz[:, :2]
    assert np.quantile(np.abs(surface.height(xy) - ground(*xy.T)), 0.99) < 0.015
    if error_deg:
        lowered = surface.height(xy) - cells.xyz[:, 2]
        assert np.polyfit(cells.reach_m, lowered, 1)[0] == pytest.approx(np.radians(error_deg), rel=0.15)


def test_the_surface_follows_waves_of_a_road() -> None:
    surface, cells = fitted(waved)
    xy = cells.xyz[cells.reach_m < 15, :2]
    assert np.std(surface.height(xy) - waved(*xy.T)) < 0.006


def test_a_laser_of_its_own_mind_is_not_followed_yet_compared() -> None:
    points, ring = scan(flat)
    points[ring == 45, 2] += 0.03
    surface, cells = fit_ground(find_road_cells(points, ring, np.zeros(len(ring), bool), 35.0)) or pytest.fail("none")
    trusted = trust_ground(cells, surface, points, SENSOR).measured(points[:, :3] + SENSOR, ())
    left = points[:, 2] - surface.height(points[:, :2])
    for own, expected in ((45, 0.03), (44, 0.0), (46, 0.0)):
        assert trusted[ring == own].mean() > 0.9
        assert np.median(left[ring == own]) == pytest.approx(expected, abs=0.006)


def test_a_road_seen_to_one_side_cannot_tell_a_cone_from_a_slope() -> None:
    surface, cells = fitted(flat, error_deg=0.2, where=lambda x, y: (x > 4) & (np.abs(y) < 3))
    assert not surface.knows_cone
    assert surface.cone_rad == 0
    assert not trust_ground(cells, surface, np.zeros((0, 4)), SENSOR).ground_range


def test_trust_ends_at_the_kerb_and_the_mesh_goes_on() -> None:
    surface, cells = fitted(crowned)
    trust = trust_ground(cells, surface, np.zeros((0, 4)), SENSOR)
    x = np.linspace(-20, 20, 81)
    for y, share in ((0.0, 0.85), (3.5, 0.85), (6.0, 0.0), (-6.0, 0.0)):
        position = np.column_stack([x, np.full_like(x, y)])
        position = position[np.abs(x) + np.abs(y) > 6] if share else position
        assert (trust.ground_at(position).mean() >= share) if share else (trust.ground_at(position).mean() <= share)
    mesh = ground_mesh(trust, surface, SENSOR)
    assert np.abs(mesh.vertices[:, 1]).max() > 6
    down = np.tile(np.float32([0, 0, -1]), (len(cells), 1))
    start = (cells.xyz + SENSOR + [0, 0, 2]).astype(np.float32)
    distance, triangle = Bvh(mesh).first_hit(start, down, np.full(len(cells), 9, np.float32))
    trusted = trust.ground_at(start[:, :2])
    assert trusted.mean() > 0.8
    assert (triangle[trusted] >= 0).all()
    height = start[trusted, 2] - distance[trusted] - SENSOR[2]
    assert np.abs(height - surface.height(cells.xyz[trusted, :2])).max() < 0.005


def test_what_stands_on_the_road_unlabelled_is_no_ground_nor_is_its_shadow() -> None:
    block = Block((9.0, 11.0), (-1.0, 1.0), -HEIGHT_M + 1.4)
    points, ring = scan(flat, blocks=(block,))
    surface, cells = fit_ground(find_road_cells(points, ring, np.zeros(len(ring), bool), 35.0)) or pytest.fail("none")
    trust = trust_ground(cells, surface, points, SENSOR)
    behind = np.array([[x, 0.0] for x in np.arange(12, 28, 1.0)])
    assert not trust.ground_at(behind).any()
    world = points[:, :3] + SENSOR
    on_it = (
        (points[:, 0] > 8.9) & (points[:, 0] < 11.1) & (np.abs(points[:, 1]) < 1.1) & (points[:, 2] > -HEIGHT_M + 0.1)
    )
    assert on_it.sum() > 100
    trusted = trust.measured(world, ())
    assert not trusted[on_it].any()
    ground = (np.abs(points[:, 2] + HEIGHT_M) < 0.05) & (np.hypot(points[:, 0], points[:, 1]) < 25)
    assert trusted[ground & (np.abs(points[:, 1]) < 12)].mean() > 0.85


@pytest.mark.parametrize(
    "points", [np.zeros((0, 4)), np.ones((1, 4)), np.random.default_rng(0).normal(0, 20, (5000, 4))]
)
def test_no_ground_is_no_fault(points: np.ndarray) -> None:
    cells = find_road_cells(points, np.zeros(len(points), int), np.zeros(len(points), bool), 35.0)
    assert fit_ground(cells) is None

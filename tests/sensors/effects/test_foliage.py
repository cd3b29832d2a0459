"""Beams enter foliage by the Beer–Lambert law, and no other material."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from assets.mesh import Mesh
from sensors.effects.points.foliage_depth import FoliageDepth
from sensors.pattern import Pattern
from sensors.scene import Scene
from sensors.sensor_model import SensorModel
from sensors.tracing import Tracer
from tests.sensors.effects.scenes import NOBODY

PATTERN = Pattern(
    name="p", sweep_s=0.1, firings=7200, range_m=(0.5, 100), elevation_deg=tuple(np.linspace(8, -8, 32).tolist())
)


def wall(material: str):
    """Hits on a wall of one material, 10 m ahead."""
    corners = np.array([[10, -20, -5], [10, 20, -5], [10, 20, 5], [10, -20, 5]])
    mesh = Mesh.of(corners, np.array([[0, 1, 2], [0, 2, 3]]), material)
    return Tracer(PATTERN.rays(), PATTERN.range_m).trace(Scene(mesh, dict.__getitem__), np.eye(4), NOBODY)


def deeper(material: str, **parameters: float) -> np.ndarray:
    hits = wall(material)
    bare = SensorModel(PATTERN).measure(hits)
    cloud = SensorModel(PATTERN, (FoliageDepth(**parameters),)).measure(hits, np.random.default_rng(3))
    assert np.array_equal(cloud.azimuth, bare.azimuth) and np.array_equal(cloud.intensity, bare.intensity)
    return np.linalg.norm(cloud.xyz, axis=1) - np.linalg.norm(bare.xyz, axis=1)


@pytest.mark.parametrize("material", ["foliage", "foliage_dark", "hedge"])
def test_depths_are_exponential_up_to_the_depth_of_the_leaves(material):
    depth = deeper(material, mean_m=0.2, most_m=0.6)
    assert len(depth) > 5000 and depth.min() > -1e-4 and depth.max() < 0.6 + 1e-4
    for at in (0.1, 0.2, 0.4):
        expected = (1 - np.exp(-at / 0.2)) / (1 - np.exp(-3.0))
        assert (depth < at).mean() == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("material", ["brick", "grass", "asphalt", "bark"])
def test_beams_do_not_enter_anything_else(material):
    assert np.abs(deeper(material, mean_m=0.2, most_m=0.6)).max() < 1e-5


def test_the_neutral_effect_does_nothing():
    assert np.abs(deeper("hedge", **FoliageDepth.neutral)).max() == 0


def test_parameters_have_bounds():
    with pytest.raises(ValidationError):
        FoliageDepth(mean_m=-0.1, most_m=1)
    with pytest.raises(ValidationError):
        FoliageDepth(mean_m=0.1, most_m=0)

"""Small scenes and shorthands for tests of effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box
from sensors.effects.registry import built_in_effects
from sensors.motion import EgoMotion
from sensors.pattern import Pattern, load_pattern
from sensors.scene import Scene
from sensors.sensor_model import SensorModel
from sensors.tracing import Tracer
from tests.sensors.worlds import block, instances, plane, pose, wall

HEIGHT_M = 1.73
LIDAR = pose(z=HEIGHT_M)
PATTERN = load_pattern("hdl64e")
STILL = EgoMotion.still(np.eye(4))
NOBODY = instances([])


def effect(name, **parameters):
    """A built-in effect, by default with the parameters of its example."""
    kind = built_in_effects()[name]
    return kind.model_validate(parameters or kind.example)


def sensor(*effects, pattern: Pattern = PATTERN) -> SensorModel:
    return SensorModel(pattern, effects, "test.yaml")


def no_model(name):
    raise AssertionError(f"model {name} was not expected")


def room(half_m: float = 30.0) -> Scene:
    """A closed room of one material, in which all beams return the same."""
    return Scene(box((2 * half_m, 2 * half_m, 40.0), (0, 0, 20.0 - 0.001), "concrete"), no_model)


def street() -> Scene:
    """Wet-able road, walls, a metal wall, a window, a sign, a hedge and models: all that an effect may care for."""
    parts = [plane(), wall(40.0), box((0.2, 30, 8), (-25, 0, 4), "cladding_metal")]
    parts += [box((8, 0.02, 4), (0, 10, 2), "window_glass"), box((20, 0.2, 6), (0, 14, 3), "brick")]
    parts += [box((0.02, 0.8, 0.8), (12, -5, 1.7), "sign_face"), box((6, 0.8, 1.8), (-16, 9, 0.9), "hedge")]
    return Scene(Mesh.merge(parts), lambda name: block((4.0, 1.7, 1.5)))


def cars(velocity=(0.0, 0.0, 0.0), yaw_rate=0.0):
    placed = instances([pose(9, 3, 0, 0.3), pose(-12, -4)])
    n = len(placed)
    return replace(placed, velocity_mps=np.tile(velocity, (n, 1)), yaw_rate_radps=np.full(n, float(yaw_rate)))


def shoot(model, scene, *, pose=LIDAR, placed=NOBODY, ego=STILL, seed=0):
    """Returns and their shot."""
    return model.trace_returns(scene, pose, placed, ego, np.random.default_rng(seed))


def of_hits(model, scene, *, pose=LIDAR, placed=NOBODY, seed=0):
    """The same from traced hits."""
    hits = Tracer(model.pattern.rays(), model.pattern.range_m).trace(scene, pose, placed)
    return model.measure_returns(hits, np.random.default_rng(seed))


def dense(returns, beams, column="range_m"):
    """A column by beam, NaN where nothing returned."""
    values = np.full(beams, np.nan)
    values[returns.beam] = getattr(returns, column)
    return values

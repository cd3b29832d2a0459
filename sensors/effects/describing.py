"""Pictures of a small scene before and after an effect."""

from __future__ import annotations

import cv2
import numpy as np

from assets.mesh import Mesh
from assets.shapes import box, plate
from sensors.effects.base import Effect, LabelEffect
from sensors.label_boxes import LabelBoxes
from sensors.motion import EgoMotion
from sensors.pattern import load_pattern
from sensors.returns import Returns
from sensors.scene import Instances, Scene
from sensors.sensor_model import SensorModel

_PANEL_PX = 360
_AHEAD_M, _ASIDE_M = (-4.0, 32.0), (-18.0, 18.0)


def example_scene() -> tuple[Scene, np.ndarray, Instances, EgoMotion]:
    """A street with a shop window, a sign and two moving cars; the LiDAR's pose; the cars; the ego vehicle."""
    ground = plate(np.array([[-60, -60], [60, -60], [60, 60], [-60, 60]], float), "asphalt")
    static = [ground, plate(np.array([[0, -0.1], [40, -0.1], [40, 0.1], [0, 0.1]], float), "road_marking", 0.01)]
    static += [box((30, 0.4, 6), (12, 12, 3), "concrete"), box((10, 0.05, 3), (14, 11, 2), "window_glass")]
    static += [box((0.2, 20, 4), (30, -4, 2), "cladding_metal"), box((0.05, 0.9, 0.9), (18, -8, 2.4), "sign_face")]
    car = Mesh.merge([box((4.2, 1.7, 0.8), (0, 0, 0.6), "car_paint"), box((2.2, 1.6, 0.6), (0, 0, 1.3), "car_glass")])
    car = Mesh.merge([car, box((0.02, 0.5, 0.12), (-2.12, 0, 0.7), "number_plate")])
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :2, 3] = [[10, -3], [16, 4]]
    instances = Instances(
        ids=("ahead", "oncoming"),
        kinds=("car", "car"),
        models=("car", "car"),
        poses=poses,
        scales=np.ones((2, 3)),
        sizes=np.tile([4.2, 1.7, 1.6], (2, 1)),
        velocity_mps=np.array([[12.0, 0, 0], [-12.0, 0, 0]]),
        yaw_rate_radps=np.zeros(2),
        paint=np.array([0.5, 0.3], np.float32),
        rgb=np.full((2, 3), 0.5, np.float32),
    )
    lidar = np.eye(4)
    lidar[2, 3] = 1.73
    ego = EgoMotion(np.eye(4), np.array([12.0, 0, 0]), 0.0, np.array([3.0, 0, 0]))
    return Scene(Mesh.merge(static), lambda name: car), lidar, instances, ego


def measure_example(effects: tuple[Effect, ...], seed: int = 0) -> tuple[Returns, np.ndarray]:
    """Return the returns of the example scene for an HDL-64E with effects, and positions (m, 3) of its points."""
    scene, pose, instances, ego = example_scene()
    sensor = SensorModel(load_pattern("hdl64e"), effects, "example")
    returns, shot = sensor.trace_returns(scene, pose, instances, ego, np.random.default_rng(seed))
    rays = shot.rays
    return returns, rays.origin[returns.beam] + rays.direction[returns.beam] * returns.range_m[:, None]


def picture(effect: Effect) -> bytes:
    """Return a PNG of the example before and after from above, with the changes of ranges and intensities."""
    if isinstance(effect, LabelEffect):
        return _encoded(_label_panels(effect))
    before, before_xyz = measure_example(())
    after, after_xyz = measure_example((effect,))
    _, old, new = np.intersect1d(before.beam, after.beam, return_indices=True)
    panels = [
        _titled("before, from above", _from_above(before_xyz, before.intensity)),
        _titled(f"after {effect.name}", _from_above(after_xyz, after.intensity)),
        _titled("range change over range", _scatter(before.range_m[old], after.range_m[new] - before.range_m[old])),
        _titled("intensity after over before", _scatter(before.intensity[old], after.intensity[new])),
    ]
    return _encoded(np.vstack([np.hstack(panels[:2]), np.hstack(panels[2:])]))


def _encoded(image: np.ndarray) -> bytes:
    done, png = cv2.imencode(".png", image)
    assert done  # encoding an 8-bit image to memory does not fail
    return png.tobytes()


def _label_panels(effect: LabelEffect) -> np.ndarray:
    """The example's cars from above with their boxes, before and after."""
    _, pose, instances, _ = example_scene()
    returns, xyz = measure_example(())
    placed = (np.linalg.inv(pose) @ instances.poses)[:, :3, 3]
    size = np.array([4.24, 1.7, 1.6])
    boxes = LabelBoxes(
        kinds=("Car",) * len(instances),
        centre=np.add(placed, [0, 0, size[2] / 2]),
        size=np.tile(size, (len(instances), 1)),
        yaw=np.zeros(len(instances)),
        kept=np.ones(len(instances), bool),
        points=xyz.astype(np.float32),
    )
    sensor = SensorModel(load_pattern("hdl64e"), (effect,), "example")
    panels = []
    for title, shown in (("before, from above", boxes), (f"after {effect.name}", sensor.relabel(boxes))):
        image = _from_above(xyz, returns.intensity)
        for centre, edges, kept in zip(shown.centre, shown.size, shown.kept, strict=True):
            high, low = (_plan_pixels(centre + sign * edges / 2) for sign in (1, -1))
            colour = (60, 170, 255) if kept else (130, 130, 130)
            cv2.rectangle(image, high, low, colour, 1)
        panels.append(_titled(title, image))
    return np.hstack(panels)


def _plan_pixels(xyz: np.ndarray) -> tuple[int, int]:
    row = (_AHEAD_M[1] - xyz[0]) / (_AHEAD_M[1] - _AHEAD_M[0]) * _PANEL_PX
    column = (_ASIDE_M[1] - xyz[1]) / (_ASIDE_M[1] - _ASIDE_M[0]) * _PANEL_PX
    return round(column), round(row)


def _from_above(xyz: np.ndarray, intensity: np.ndarray) -> np.ndarray:
    image = np.zeros((_PANEL_PX, _PANEL_PX, 3), np.uint8)
    row = (_AHEAD_M[1] - xyz[:, 0]) / (_AHEAD_M[1] - _AHEAD_M[0]) * _PANEL_PX
    column = (_ASIDE_M[1] - xyz[:, 1]) / (_ASIDE_M[1] - _ASIDE_M[0]) * _PANEL_PX
    seen = (row >= 0) & (row < _PANEL_PX) & (column >= 0) & (column < _PANEL_PX)
    shade = (np.clip(intensity, 0, 1) * 255).astype(np.uint8)
    colour = cv2.applyColorMap(shade[:, None], cv2.COLORMAP_VIRIDIS)[:, 0]
    image[row[seen].astype(int), column[seen].astype(int)] = colour[seen]
    return image


def _scatter(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    image = np.full((_PANEL_PX, _PANEL_PX, 3), 255, np.uint8)
    if not len(x):
        return image
    changes = y[y != 0] if y.any() else y  # a few changes among many that are none still set the scale
    low, high = (0.0, float(y.max())) if y.min() >= 0 else np.percentile(changes, (2, 98))
    low, high = min(low, 0.0), max(high, 0.0, low + 1e-3)
    column = 50 + _pixels(x, 0.0, float(x.max()) + 1e-6)
    row = _PANEL_PX - 30 - _pixels(y, low, high)
    dots = np.zeros((_PANEL_PX, _PANEL_PX), np.uint8)
    dots[row, column] = 1
    image[cv2.dilate(dots, np.ones((3, 3), np.uint8)) > 0] = (160, 80, 20)
    cv2.line(image, (46, 30), (46, _PANEL_PX - 26), (170, 170, 170), 1)
    cv2.line(image, (46, _PANEL_PX - 26), (_PANEL_PX - 10, _PANEL_PX - 26), (170, 170, 170), 1)
    for value, at in ((low, _PANEL_PX - 28), (high, 34)):
        cv2.putText(image, f"{value:.3g}", (2, int(at)), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0), 1, cv2.LINE_AA)
    at = (50, _PANEL_PX - 8)
    cv2.putText(image, f"0 ... {x.max():.3g}", at, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0), 1, cv2.LINE_AA)
    return image


def _pixels(values: np.ndarray, low: float, high: float) -> np.ndarray:
    return (np.clip((values - low) / (high - low), 0, 1) * (_PANEL_PX - 60)).astype(int)


def _titled(title: str, image: np.ndarray) -> np.ndarray:
    bar = np.full((24, image.shape[1], 3), 235, np.uint8)
    cv2.putText(bar, title, (6, 17), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 1, cv2.LINE_AA)
    return np.vstack([bar, image])

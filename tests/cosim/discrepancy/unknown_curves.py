"""Curves of every channel over every kind of covariate, and a small street in which their effects act."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy import stats

from assets.materials import MATERIAL_NAMES
from cosim.discrepancy.unknown.curve import CHANNEL_UNITS, Curve
from sensors.effects.acting import in_order
from sensors.effects.base import Effect
from sensors.effects.expectation import Expectation, expect
from sensors.effects.points.intensity_noise import IntensityNoise
from sensors.effects.points.range_noise import RangeNoise
from sensors.hits import NOTHING
from sensors.motion import EgoMotion
from sensors.pattern import Pattern
from sensors.returns import Returns
from sensors.sensor_model import SensorModel
from sensors.shot import Shot
from tests.sensors.effects.scenes import LIDAR, cars, street

PATTERN = Pattern(
    name="street",
    sweep_s=0.1,
    firings=360,
    range_m=(0.9, 120.0),
    elevation_deg=tuple(np.linspace(4, -20, 16).tolist()),
    block=(0,) * 8 + (1,) * 8,
)
EGO = EgoMotion(np.eye(4), np.array([10.0, 2.0, 0.0]), 0.3, np.array([2.0, 0.0, 0.0]))
FRAME_TIME_S = 4.5
NOISE = (RangeNoise(sigma_m=0.02), IntensityNoise(sigma_rel=0.1))
SIZES = {
    "range": 0.2, "azimuth_error": 5e-3, "elevation_error": 5e-3, "intensity": -0.4, "intensity_offset": 0.1,
    "drop": -0.4, "range_variance": 0.7, "intensity_variance": 0.7, "spurious": 0.1, "early": 0.1, "late": 0.1,
}  # fmt: skip
SHARED = {name: 0.1 for name in CHANNEL_UNITS if name.startswith("shared_")} | {
    "shared_range": 0.05,
    "shared_azimuth_error": 2e-3,
    "shared_elevation_error": 2e-3,
}
_NUMBERS = {
    "constant": ("", np.zeros(1), 0.0),
    "range": ("m", np.linspace(4, 60, 12), 0.0),
    "incidence": ("deg", np.linspace(0, 85, 12), 0.0),
    "elevation": ("deg", np.linspace(-20, 4, 12), 0.0),
    "azimuth": ("rad", np.linspace(-3, 3, 12), 2 * np.pi),
    "firing_time": ("s", np.linspace(-0.05, 0.05, 12), 0.0),
    "frame_time": ("s", np.arange(12.0), 0.0),
    "albedo": ("", np.linspace(0.1, 0.8, 12), 0.0),
    "intensity": ("", np.linspace(0.05, 0.8, 12), 0.0),
    "speed": ("m/s", np.linspace(0, 20, 12), 0.0),
    "acceleration": ("m/s²", np.linspace(-3, 3, 12), 0.0),
    "yaw_rate": ("rad/s", np.linspace(-0.5, 0.5, 12), 0.0),
    "world_x": ("m", np.linspace(-40, 40, 12), 0.0),
    "world_y": ("m", np.linspace(-40, 40, 12), 0.0),
    "world_azimuth": ("rad", np.linspace(-3, 3, 12), 2 * np.pi),
    "retro_distance": ("firings", np.array([0.5, 1, 2, 4, 8, 16, 32, 64.0]), 0.0),
    "object_distance": ("m", np.linspace(0, 12, 12), 0.0),
    "previous_range": ("m", np.linspace(0, 60, 12), 0.0),
    "above_intensity": ("", np.linspace(0, 0.8, 12), 0.0),
}
_CATEGORIES = {
    "ring": tuple(str(ring) for ring in range(16)),
    "block": ("upper", "lower"),
    "material": MATERIAL_NAMES[:20],
    "kind": ("car", "truck"),
    "model": ("block", "other"),
    "below_lost": ("seen", "lost"),
    "edge": ("clear", "edge"),
}
COVARIATES = (*_NUMBERS, *_CATEGORIES, "scan", "time")
PAIRS = (("azimuth", "elevation"), ("block", "frame_time"), ("ring", "range"), ("range", "incidence"))


def curve_of(channel: str, *covariates: str, size: float | None = None) -> Curve:
    """A curve of usual size that varies over its covariates."""
    size = SIZES[channel] if size is None else size
    if covariates == ("time",):
        y = size * np.array([0.6, 0.8])
        return Curve(channel, ("time",), ("s",), (("cosine", "sine"),), y, np.abs(y) / 50, frequency_hz=17.3)
    units, axes, parts, periods = [], [], [], []
    for name in covariates:
        unit, axis, period = _axis(name)
        x = np.arange(float(len(axis))) if isinstance(axis, tuple) else axis
        units, axes, periods = [*units, unit], [*axes, axis], [*periods, period]
        part = 0.6 + 0.4 * np.cos(x) if period or isinstance(axis, tuple) else 1 - 0.7 * (x - x[0]) / (np.ptp(x) or 1)
        parts.append(part)
    y = size * (parts[0] if len(parts) == 1 else np.outer(*parts))
    return Curve(channel, covariates, tuple(units), tuple(axes), y, np.full(y.shape, abs(size) / 50), tuple(periods))


def shared_curve(channel: str, unit: str, size: float | None = None) -> Curve:
    """A curve of the standard deviation of a shared error."""
    y = np.array([SHARED[channel] if size is None else size])
    return Curve(channel, (unit,), ("",), ((unit,),), y, y / 20)


def _axis(name: str) -> tuple[str, np.ndarray | tuple[str, ...], float]:
    if name == "scan":
        return "s", np.arange(12.0) * 0.5, 0.0
    if name in _CATEGORIES:
        return "", _CATEGORIES[name], 0.0
    return _NUMBERS[name]


def sensor_of(effects: tuple[Effect, ...]) -> SensorModel:
    """A noisy sensor with effects."""
    return SensorModel(PATTERN, (*NOISE, *effects), "test.yaml")


def traced(effects: tuple[Effect, ...] = ()) -> Shot:
    """The street as beams changed by effects meet it; a fresh shot, traced once where beams are not changed."""
    sensor = sensor_of(effects)
    if not sensor.beam_effects:
        shot = _nominal()
        return Shot(
            PATTERN, shot.rays, beams=shot.beams, traced=shot.traced, world=shot.world, frame_time_s=FRAME_TIME_S
        )
    return sensor.trace(street(), LIDAR, cars(), EGO, np.random.default_rng(0), frame_time_s=FRAME_TIME_S)


@cache
def _nominal() -> Shot:
    return sensor_of(()).trace(street(), LIDAR, cars(), EGO, np.random.default_rng(0), frame_time_s=FRAME_TIME_S)


def measured(effects: tuple[Effect, ...], shot: Shot, seed: int = 0) -> Returns:
    """Returns of a traced street by a noisy sensor with effects."""
    return sensor_of(effects).returns_of(shot, np.random.default_rng(seed))


def expected(effects: tuple[Effect, ...], shot: Shot) -> Expectation:
    """What a noisy sensor with effects predicts of a traced street."""
    return expect(in_order(sensor_of(effects).effects), shot)


def log_likelihood(effects: tuple[Effect, ...], shot: Shot, scans: list[Returns]) -> float:
    """Of scans under the prediction of a sensor with effects, by its means, spreads, probabilities and densities."""
    of, total = expected(effects, shot), 0.0
    for scan in scans:
        beam = scan.beam
        of_range = stats.norm.pdf(scan.range_m, of.range_m[beam], of.range_sigma_m[beam])
        spread = np.maximum(of.intensity_sigma[beam], 1e-3)
        is_own = scan.instance != NOTHING
        of_light = np.where(is_own, stats.norm.logpdf(scan.intensity, of.intensity[beam], spread), 0.0)
        spurious_per_m = sum(effect.density(beam, scan.range_m.astype(float), shot) for effect in effects)
        total += float(
            np.log(np.maximum(np.nan_to_num(of.seen[beam] * of_range) + spurious_per_m, 1e-12)).sum() + of_light.sum()
        )
        is_silent = np.ones(len(shot.rays), bool)
        is_silent[beam] = False
        total += float(np.log(np.maximum(of.silent[is_silent], 1e-12)).sum())
    return total


def object_curve(what: str) -> Curve:
    """A curve of cars that are longer and narrower than in the twin, or farther ahead and higher."""
    y = np.array([[0.2, -0.1, 0.05], [0.0, 0.0, 0.1]])
    axes = {"object_size": ("length", "width", "height"), "object_place": ("ahead", "left", "up")}[what]
    return Curve("range", ("kind", what), ("", "m"), (("car", "truck"), axes), y, np.full(y.shape, 0.01))

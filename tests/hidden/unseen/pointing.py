"""Beams that truly point elsewhere: errors of azimuth or elevation that depend on range, time, azimuth or a vibration.

An azimuth error of whole scans is a yaw of their poses, and one or no wave per turn of the elevation is a tilt or an
offset of the mount; none of these is drawn.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hidden.head import Aim, Beams
from tests.hidden.truth import Finding
from tests.hidden.unseen.kind import AZIMUTH, TIME, Kind, Parameters, World, amplitude, bell, curve, pick, uniform

_AXES = ("azimuth", "elevation")
_SHAPES = ("step", "saturating", "ramp")
_DISTANCES = np.linspace(2.0, 60.0, 30)
_TURN = np.linspace(-np.pi, np.pi, 37)
_WAVES = (2, 3, 4)
_VIBRATION_HZ, _ALIAS_HZ = (4.0, 40.0), 0.12  # a frequency that frames always meet at one phase is a wave per turn


def _of_range(p: Parameters, distance: np.ndarray) -> np.ndarray:
    if p["shape"] == "step":
        value = (distance > p["at_m"]).astype(float)
    elif p["shape"] == "saturating":
        value = 1 - np.exp(-distance / p["at_m"])
    else:
        value = np.clip(distance / (3 * p["at_m"]), 0, 1)
    return p["size_deg"] * 2 * (value - p["mean"])


def _draw_by_range(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    axis, distance = pick(rng, _AXES), world.values(lambda scan: scan.range_m)
    at = float(np.quantile(distance, rng.uniform(0.3, 0.7)))
    p = {
        "axis": axis,
        "size_deg": amplitude(rng, level, f"{axis}_deg", signed=True),
        "shape": pick(rng, _SHAPES),
        "at_m": round(at, 3),
        "mean": 0.0,
    }
    mean = float(_of_range({**p, "size_deg": 0.5}, distance).mean())
    return {**p, "mean": round(mean, 5)}


def _aim_by_range(aim: Aim, beams: Beams, frame: dict, distance: np.ndarray, rng, p: Parameters) -> None:
    _turn(aim, p, np.where(np.isfinite(distance), _of_range(p, np.where(np.isfinite(distance), distance, 0)), 0))


def _truth_by_range(p: Parameters, world: World) -> tuple[Finding, ...]:
    y = np.radians(_of_range(p, _DISTANCES))
    shape = curve("range", "m", _DISTANCES, y)
    return (Finding((f"{p['axis']}_error",), (("range",),), beside=_mean_effect(p), curve=shape),)


def _mean_effect(p: Parameters) -> tuple[str, ...]:
    """Catalogue effects that describe the mean of the error."""
    return ("elevation_offset", "mount_rotation") if p["axis"] == "elevation" else ("mount_rotation",)


def _draw_by_azimuth(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    axis = pick(rng, _AXES)
    size = {"axis": axis, "size_deg": amplitude(rng, level, f"{axis}_deg", signed=True)}
    if rng.random() < 0.5:
        return size | {"shape": "waves", "waves": pick(rng, _WAVES), "phase_deg": uniform(rng, 0, 360)}
    return size | {"shape": "bell", "centre_rad": uniform(rng, -np.pi, np.pi), "width_rad": uniform(rng, 0.3, 0.8)}


def _of_azimuth(p: Parameters, azimuth: np.ndarray) -> np.ndarray:
    if p["shape"] == "waves":
        return p["size_deg"] * np.sin(p["waves"] * azimuth + np.radians(p["phase_deg"]))
    return 1.5 * p["size_deg"] * bell(azimuth, p["centre_rad"], p["width_rad"], 2 * np.pi)


def _aim_by_azimuth(aim: Aim, beams: Beams, frame: dict, distance: np.ndarray, rng, p: Parameters) -> None:
    _turn(aim, p, _of_azimuth(p, beams.azimuth))


def _truth_by_azimuth(p: Parameters, world: World) -> tuple[Finding, ...]:
    beside = _mean_effect(p)
    if p["shape"] == "bell" and p["axis"] == "azimuth":
        beside = (*beside, "encoder_eccentricity")
    shape = curve("azimuth", "rad", _TURN, np.radians(_of_azimuth(p, _TURN)))
    return (Finding((f"{p['axis']}_error",), (AZIMUTH,), beside=beside, curve=shape),)


def _draw_drift(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    shape, duration = pick(rng, ("line", "settling")), world.duration_s
    p = {
        "axis": "elevation",
        "size_deg": amplitude(rng, level, "elevation_deg", signed=True),
        "shape": shape,
        "middle_s": round(duration / 2, 3),
        "tau_s": round(duration * uniform(rng, 0.2, 0.5), 3),
        "mean": 0.0,
    }
    times = np.array([frame["time_s"] for frame in world.frames]) - world.frames[0]["time_s"]
    return {**p, "mean": round(float(_of_time({**p, "size_deg": 1.0}, times).mean()), 5), "start_s": _start(world)}


def _of_time(p: Parameters, elapsed_s: np.ndarray) -> np.ndarray:
    if p["shape"] == "line":
        value = (elapsed_s - p["middle_s"]) / p["middle_s"]
    else:
        value = 2 * (1 - np.exp(-elapsed_s / p["tau_s"]))
    return p["size_deg"] * (value - p["mean"])


def _aim_drift(aim: Aim, beams: Beams, frame: dict, distance: np.ndarray, rng, p: Parameters) -> None:
    _turn(aim, p, _of_time(p, frame["time_s"] - p["start_s"] + beams.time_s))


def _truth_drift(p: Parameters, world: World) -> tuple[Finding, ...]:
    elapsed = np.array([frame["time_s"] for frame in world.frames]) - p["start_s"]
    shape = curve("frame_time", "s", elapsed, np.radians(_of_time(p, elapsed)))
    return (Finding(("elevation_error",), (TIME,), beside=("elevation_offset",), curve=shape),)


def _draw_vibration(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    axis = pick(rng, _AXES)
    step_s = float(np.median(np.diff([frame["time_s"] for frame in world.frames])))
    while True:
        frequency = uniform(rng, *_VIBRATION_HZ)
        phases = np.mod(frequency * step_s, 1)
        if min(phases, 1 - phases) > _ALIAS_HZ and abs(phases - 0.5) > _ALIAS_HZ:
            break
    size = amplitude(rng, level, f"{axis}_deg")
    return {"axis": axis, "size_deg": size, "frequency_hz": frequency, "phase_deg": uniform(rng, 0, 360)}


def _aim_vibration(aim: Aim, beams: Beams, frame: dict, distance: np.ndarray, rng, p: Parameters) -> None:
    time_s = frame["time_s"] + beams.time_s
    wave = np.sin(2 * np.pi * p["frequency_hz"] * time_s + np.radians(p["phase_deg"]))
    _turn(aim, p, 2**0.5 * p["size_deg"] * wave)


def _truth_vibration(p: Parameters, world: World) -> tuple[Finding, ...]:
    channel = f"{p['axis']}_error"
    wave_per_turn = Finding((channel,), (AZIMUTH, TIME))
    return (Finding((channel,), (("time", "vibration", "phase", "frame_time"),), also=(wave_per_turn,)),)


def _turn(aim: Aim, p: Parameters, degrees: np.ndarray) -> None:
    if p["axis"] == "azimuth":
        aim.azimuth += np.radians(degrees)
    else:
        aim.elevation += np.radians(degrees)


def _start(world: World) -> float:
    return float(world.frames[0]["time_s"])


def _stage(p: Parameters) -> str:
    return "aim"


POINTING: dict[str, Kind] = {
    "angle_by_range": Kind(_draw_by_range, _truth_by_range, _stage, _aim_by_range),
    "angle_by_azimuth": Kind(_draw_by_azimuth, _truth_by_azimuth, _stage, _aim_by_azimuth),
    "elevation_drift": Kind(_draw_drift, _truth_drift, _stage, _aim_drift),
    "vibration": Kind(_draw_vibration, _truth_vibration, _stage, _aim_vibration),
}

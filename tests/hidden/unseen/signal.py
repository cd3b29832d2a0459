"""Response, noise and losses: a kinked response, noise that depends on something, losses in bursts."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hidden.columns import made_of
from tests.hidden.scan import Scan
from tests.hidden.truth import Finding
from tests.hidden.unseen.kind import AZIMUTH, SIGNAL, Kind, Parameters, World, amplitude, bell, curve, pick, uniform

_LIGHT = np.linspace(0.02, 0.9, 30)
_TURN = np.linspace(-np.pi, np.pi, 37)
_PAINTED = ("kind", "model", "instance")


def _draw_kink(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    light = world.values(lambda scan: scan.intensity)
    at, high = (float(np.quantile(light, share)) for share in (rng.uniform(0.3, 0.6), 0.95))
    size = amplitude(rng, level, "intensity", signed=True)
    return {"at": round(at, 4), "slope": round(float(np.clip(2 * size * high / max(high - at, 0.05), -0.9, 4)), 5)}


def _kink(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    scan.intensity += p["slope"] * np.maximum(scan.intensity - p["at"], 0)


def _truth_kink(p: Parameters, world: World) -> tuple[Finding, ...]:
    factor = 1 + p["slope"] * np.maximum(_LIGHT - p["at"], 0) / _LIGHT
    shape = curve("intensity", "", _LIGHT, np.log(factor))
    return (Finding(("intensity", "intensity_offset"), (SIGNAL,), effects=("detector_compression",), curve=shape),)


def _draw_noise(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    p: dict[str, Any] = {
        "channel": pick(rng, ("range", "intensity")),
        "by": pick(rng, ("azimuth", "signal", "material")),
    }
    p["factor"] = round(1 + amplitude(rng, level, "spread"), 4)
    if p["by"] == "azimuth":
        return p | {"centre_rad": uniform(rng, -np.pi, np.pi), "width_rad": uniform(rng, 0.3, 1.0)}
    if p["by"] == "signal":
        light = world.values(lambda scan: scan.intensity)
        return p | {"below": round(float(np.quantile(light, rng.uniform(0.3, 0.6))) + 1e-3, 4)}
    return p | {"material": pick(rng, world.materials(0.03, 0.6))}


def _noise(scan: Scan, channel: str, p: Parameters) -> np.ndarray:
    if channel != p["channel"]:
        return np.ones(len(scan.found))
    if p["by"] == "azimuth":
        weight = bell(scan.beams.azimuth, p["centre_rad"], p["width_rad"], 2 * np.pi)
    elif p["by"] == "signal":
        weight = (scan.intensity < p["below"]).astype(float)
    else:
        weight = made_of(scan, (p["material"],)).astype(float)
    return 1 + (p["factor"] - 1) * weight


def _truth_noise(p: Parameters, world: World) -> tuple[Finding, ...]:
    shape = None
    if p["by"] == "azimuth":
        names = AZIMUTH
        weight = bell(_TURN, p["centre_rad"], p["width_rad"], 2 * np.pi)
        shape = curve("azimuth", "rad", _TURN, np.log(1 + (p["factor"] - 1) * weight))
    elif p["by"] == "signal":
        names = SIGNAL
    else:
        names = material_names(p["material"])
    return (Finding((f"{p['channel']}_variance",), (names,), beside=(f"{p['channel']}_noise",), curve=shape),)


def material_names(material: str) -> tuple[str, ...]:
    """Accepted names of a dependence on one material."""
    return (*SIGNAL, *_PAINTED) if material.startswith("car_") else SIGNAL


def _draw_bursts(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    scope = pick(rng, ("laser", "head"))
    return {"scope": scope, "size": amplitude(rng, level, "loss"), "length": uniform(rng, 4, 15)}


def _bursts(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    shape = (scan.beams.rings, scan.beams.firings)
    rows = shape[0] if p["scope"] == "laser" else 1
    starts = rng.random((rows, shape[1])) < p["size"] / p["length"]
    length = rng.geometric(1 / p["length"], starts.shape)
    until = np.maximum.accumulate(np.where(starts, np.arange(shape[1]) + length, 0), axis=1)
    is_lost = np.broadcast_to(until > np.arange(shape[1]), shape)
    scan.found &= ~is_lost.ravel()


def _truth_bursts(p: Parameters, world: World) -> tuple[Finding, ...]:
    beside = ("random_dropout",)
    shared = Finding(("shared_drop",), (("firing", "packet", "sector"),), beside=beside)
    previous = ("previous_lost", "previous_range", "previous_intensity")
    if p["scope"] == "laser":
        return (
            Finding(("drop",), (previous,), beside=beside, also=(Finding(("shared_drop",), (("packet", "sector"),)),)),
        )
    neighbours = (*previous, "above_lost", "below_lost", "above_range", "below_range")
    return (Finding(shared.channels, shared.covariates, beside=beside, also=(Finding(("drop",), (neighbours,)),)),)


SIGNALS: dict[str, Kind] = {
    "intensity_kink": Kind(_draw_kink, _truth_kink, lambda p: "signal", _kink),
    "noise_by": Kind(_draw_noise, _truth_noise, lambda p: "spread", _noise),
    "loss_bursts": Kind(_draw_bursts, _truth_bursts, lambda p: "detected", _bursts, is_random=lambda p: True),
}

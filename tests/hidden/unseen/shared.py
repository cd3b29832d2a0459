"""Errors that all beams of a firing or of a packet of firings have in common."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hidden.columns import firing
from tests.hidden.head import Aim, Beams
from tests.hidden.scan import Scan
from tests.hidden.truth import Finding
from tests.hidden.unseen.kind import Kind, Parameters, World, amplitude, pick, uniform

_CHANNELS = ("range", "azimuth", "elevation", "intensity", "drop")
_SIZES = {"range": "range_m", "azimuth": "azimuth_deg", "elevation": "elevation_deg", "intensity": "intensity"}
_PACKETS = (4, 6, 12)
_UNIT_NAMES = ("firing", "packet")  # a unit's error is also one of the smaller or larger unit
_NOISE = {"range": "range_noise", "intensity": "intensity_noise", "drop": "random_dropout"}


def _draw(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    channel, unit = pick(rng, _CHANNELS), pick(rng, _UNIT_NAMES)
    p = {"channel": channel, "unit": unit, "firings": 1 if unit == "firing" else pick(rng, _PACKETS)}
    if channel == "drop":
        return p | {"size": amplitude(rng, level, "loss"), "lost_share": uniform(rng, 0.6, 1.0)}
    return p | {"size": amplitude(rng, level, _SIZES[channel])}


def _errors(rng: np.random.Generator, number: np.ndarray, p: Parameters) -> np.ndarray:
    """(n,) the unit's error, standard deviation 1."""
    units = number // p["firings"]
    return (rng.standard_t(5, int(units.max()) + 1) * (3 / 5) ** 0.5)[units]


def _act(*arguments) -> None:
    *first, rng, p = arguments
    if p["channel"] in ("azimuth", "elevation"):
        aim, beams, *_ = first
        _aim(aim, beams, rng, p)
    else:
        _measure(first[0], rng, p)


def _aim(aim: Aim, beams: Beams, rng: np.random.Generator, p: Parameters) -> None:
    number = np.tile(np.arange(beams.firings), beams.rings)
    angle = getattr(aim, p["channel"])
    angle += np.radians(p["size"]) * _errors(rng, number, p)


def _measure(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    number = firing(scan)
    if p["channel"] == "range":
        scan.range_m += p["size"] * _errors(rng, number, p)
    elif p["channel"] == "intensity":
        scan.intensity *= np.maximum(1 + p["size"] * _errors(rng, number, p), 0.05)
    else:
        units = number // p["firings"]
        is_hit = (rng.random(int(units.max()) + 1) < p["size"] / p["lost_share"])[units]
        scan.found &= ~(is_hit & (rng.random(len(units)) < p["lost_share"]))


def _truths(p: Parameters, world: World) -> tuple[Finding, ...]:
    channel = p["channel"]
    names = (f"shared_{channel}", f"shared_{channel}_error") if channel in ("azimuth", "elevation") else ()
    also = ()
    if channel in ("range", "intensity", "drop"):
        neighbour = "lost" if channel == "drop" else channel
        beside = [f"{which}_{neighbour}" for which in ("above", "below")]
        if p["unit"] == "packet":
            beside.append(f"previous_{neighbour}")
        also = (Finding((channel,), (tuple(beside),)),)
    noise = (_NOISE[channel],) if channel in _NOISE else ()
    units = (*_UNIT_NAMES, "sector") if p["unit"] == "packet" else _UNIT_NAMES
    return (Finding(names or (f"shared_{channel}",), (units,), beside=noise, also=also),)


def _stage(p: Parameters) -> str:
    stages = {"range": "range", "intensity": "signal", "drop": "detected"}
    return stages.get(p["channel"], "aim")


SHARED: dict[str, Kind] = {"shared_error": Kind(_draw, _truths, _stage, _act, is_random=lambda p: True)}

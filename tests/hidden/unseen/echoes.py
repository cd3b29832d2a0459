"""Returns from elsewhere: wet and dirty surfaces, the own vehicle, light before reflectors, folded ranges, the sun."""

from __future__ import annotations

from typing import Any

import numpy as np

from tests.hidden.clutter import reply
from tests.hidden.columns import made_of
from tests.hidden.scan import Scan
from tests.hidden.truth import Finding
from tests.hidden.unseen.kind import (
    AZIMUTH,
    RINGS,
    Kind,
    NotApplicableError,
    Parameters,
    World,
    amplitude,
    bell,
    pick,
    uniform,
)
from tests.hidden.unseen.signal import material_names

_NEAREST_GAP_M = 0.5  # an echo nearer to its surface is a range error
_FEWEST_EVENTS = 60  # in a drive
_SHARES = {"quarter": 0.12, "half": 0.25, "one": 0.5, "strong": 1.0}


def _draw_surface(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    return {
        "side": pick(rng, ("late", "early")),
        "material": pick(rng, world.materials(0.03, 0.6)),
        "share": amplitude(rng, level, "echo"),
        "gap_m": uniform(rng, 1.0, 3.0),
    }


def _surface(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    is_hit = made_of(scan, (p["material"],)) & scan.found & (rng.random(len(scan.found)) < p["share"])
    gap = _NEAREST_GAP_M + rng.exponential(p["gap_m"], len(is_hit))
    moved = scan.range_m + (gap if p["side"] == "late" else -gap)
    near, far = scan.beams.range_m
    rows = np.flatnonzero(is_hit & (moved > near) & (moved < far))
    reply(scan, rows, moved[rows], 0.5 * scan.intensity[rows])


def _truth_surface(p: Parameters, world: World) -> tuple[Finding, ...]:
    is_road = p["side"] == "late" and world.scans[0].table.road[world.scans[0].table.row[p["material"]]]
    effects = ("wet_road",) if is_road else ()
    return (Finding((p["side"], "spurious"), (material_names(p["material"]),), effects=effects),)


def _draw_own(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    rings = world.beams.rings
    first = int(rng.integers(rings // 2, rings - rings // 8))
    return {
        "centre_rad": uniform(rng, -np.pi, np.pi),
        "width_rad": uniform(rng, 0.08, 0.4),
        "rings": [first, min(first + int(rng.integers(rings // 8, rings // 3)), rings - 1)],
        "range_m": uniform(rng, 1.1, 2.3),
        "share": round(_SHARES[level] * uniform(rng, 0.7, 1.0), 4),
    }


def _own(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    away = np.mod(scan.beams.azimuth - p["centre_rad"] + np.pi, 2 * np.pi) - np.pi
    inside = (np.abs(away) < p["width_rad"] / 2) & (scan.beams.ring >= p["rings"][0])
    inside &= (scan.beams.ring <= p["rings"][1]) & (rng.random(len(away)) < p["share"])
    rows = np.flatnonzero(inside)
    reply(scan, rows, p["range_m"] + rng.laplace(0, 0.02, len(rows)), rng.uniform(0.02, 0.2, len(rows)))


def _truth_own(p: Parameters, world: World) -> tuple[Finding, ...]:
    return (Finding(("early", "spurious"), ((*AZIMUTH, *RINGS),)),)


def _near_reflector(scan: Scan, firings: int) -> tuple[np.ndarray, np.ndarray]:
    """(n,) bool: a reflector is met within some firings on the same ring; (n,) its distance."""
    shape = (scan.beams.rings, scan.beams.firings)
    is_retro = (scan.table.retro[scan.material] & (scan.material >= 0) & np.isfinite(scan.solid.distance)).reshape(
        shape
    )
    distance = np.where(is_retro, scan.solid.distance.reshape(shape), np.inf)
    nearest = distance.copy()
    for step in range(1, firings + 1):
        nearest = np.minimum(nearest, np.minimum(np.roll(distance, step, 1), np.roll(distance, -step, 1)))
    return np.isfinite(nearest).ravel(), nearest.ravel()


def _draw_reflector(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    p = {"firings": int(rng.integers(2, 13)), "share": min(round(12 * amplitude(rng, level, "echo"), 5), 0.6)}
    events = np.mean([_near_reflector(scan, p["firings"])[0].sum() for scan in world.scans]) * p["share"]
    if events * len(world.frames) < _FEWEST_EVENTS:
        raise NotApplicableError
    return p


def _reflector(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    is_near, distance = _near_reflector(scan, p["firings"])
    echo = distance * rng.uniform(0.3, 0.95, len(distance))
    surface = np.where(scan.found, scan.range_m, np.inf)
    is_first = (echo < surface - _NEAREST_GAP_M) & (echo > scan.beams.range_m[0])
    rows = np.flatnonzero(is_near & is_first & (rng.random(len(echo)) < p["share"]))
    reply(scan, rows, echo[rows], rng.uniform(0.02, 0.15, len(rows)))


def _truth_reflector(p: Parameters, world: World) -> tuple[Finding, ...]:
    names = ("retro_distance", "material", "albedo", "intensity", "previous_intensity", "above_intensity")
    return (Finding(("early", "spurious"), (names,)),)


def _draw_folding(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    distance = world.values(lambda scan: scan.range_m)
    limit = float(np.quantile(distance, rng.uniform(0.9, 0.985)))
    return {"limit_m": round(limit, 2), "share": _SHARES[level]}


def _folding(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    is_far = scan.found & (scan.range_m > p["limit_m"]) & (rng.random(len(scan.found)) < p["share"])
    folded = scan.range_m - p["limit_m"]
    scan.found &= ~(is_far & (folded < scan.beams.range_m[0]))
    rows = np.flatnonzero(is_far & scan.found)
    reply(scan, rows, folded[rows], scan.intensity[rows])


def _truth_folding(p: Parameters, world: World) -> tuple[Finding, ...]:
    return (Finding(("early", "spurious"), (("range",),)),)


def _draw_sun(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    does = pick(rng, ("spurious", "drop"))
    size = amplitude(rng, level, "echo" if does == "spurious" else "loss")
    return {
        "does": does,
        "size": size,
        "direction_rad": uniform(rng, -np.pi, np.pi),
        "width_rad": uniform(rng, 0.15, 0.5),
    }


def _sun(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
    world_azimuth = np.arctan2(scan.direction[:, 1], scan.direction[:, 0])
    chance = p["size"] * bell(world_azimuth, p["direction_rad"], p["width_rad"], 2 * np.pi)
    rows = np.flatnonzero(rng.random(len(chance)) < chance)
    if p["does"] == "drop":
        scan.found[rows] = False
    else:
        reply(scan, rows, rng.uniform(*scan.beams.range_m, len(rows)), rng.uniform(0, 0.1, len(rows)))


def _truth_sun(p: Parameters, world: World) -> tuple[Finding, ...]:
    names, effects = ("world_azimuth", "sun_azimuth"), ()
    if np.radians(world.heading_range_deg) < p["width_rad"]:  # the ego vehicle does not turn enough
        names, effects = (*names, *AZIMUTH), ("false_alarms",) if p["does"] == "spurious" else ()
    beside = ("random_dropout",) if p["does"] == "drop" else ()
    # A uniform return in front of a surface is early, one behind it late.
    channels = ("spurious", "early", "late") if p["does"] == "spurious" else ("drop",)
    return (Finding(channels, (names,), effects=effects, beside=beside),)


def _clutter(p: Parameters) -> str:
    return "clutter"


def _always(p: Parameters) -> bool:
    return True


ECHOES: dict[str, Kind] = {
    "surface_echoes": Kind(_draw_surface, _truth_surface, _clutter, _surface, _always),
    "own_vehicle": Kind(_draw_own, _truth_own, _clutter, _own, _always),
    "before_reflectors": Kind(_draw_reflector, _truth_reflector, _clutter, _reflector, _always),
    "range_folding": Kind(_draw_folding, _truth_folding, _clutter, _folding, _always),
    "sunlight": Kind(_draw_sun, _truth_sun, _clutter, _sun, _always),
}

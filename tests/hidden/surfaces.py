"""Hidden physics of which surface answers: footprints, wet roads, panes and mirrors."""

from __future__ import annotations

import numpy as np

from tests.hidden.scan import Scan

_C_M_PER_NS = 0.299792458
_WET_PATH_M = 60.0


def beam_divergence(scan: Scan, rng, divergence_mrad: float, pulse_ns: float) -> None:
    """Seven rays of equal weight have the second moment of a round footprint."""
    n, half = len(scan.found), divergence_mrad / 2000
    across = np.cross(scan.direction, [0.0, 0, 1])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(across, scan.direction)
    heard = [(scan.solid, scan.direction)]
    for angle in np.arange(6) * np.pi / 3:
        aside = scan.direction + 0.764 * half * (np.cos(angle) * across + np.sin(angle) * up)
        aside /= np.linalg.norm(aside, axis=1, keepdims=True)
        heard.append((scan.cast(scan.origin, aside, scan.aim.after, scan.beams.range_m)[0], aside))
    distance = np.stack([s.distance for s, _ in heard])
    rho = np.stack([np.where(np.isfinite(s.distance), scan.reflectance(s.material, s.instance), 0) for s, _ in heard])
    normal = np.stack([s.normal for s, _ in heard])
    offset = np.einsum("kij,kij->ki", normal, np.stack([d for _, d in heard]))
    offset *= np.where(np.isfinite(distance), distance, 0)  # of the tangent plane, from the beam's origin
    order = np.argsort(distance, axis=0)
    distance, rho, offset = (np.take_along_axis(a, order, 0) for a in (distance, rho, offset))
    normal = np.take_along_axis(normal, order[..., None], 0)
    with np.errstate(invalid="ignore"):
        gap = np.diff(distance, axis=0)
        flat = (np.einsum("kij,kij->ki", normal[1:], normal[:-1]) > 0.999) & (np.abs(np.diff(offset, axis=0)) < 0.02)
        apart = ~((gap < pulse_ns * _C_M_PER_NS / 2) | flat)
    echo = np.concatenate([np.zeros((1, n), int), np.cumsum(apart, axis=0)])
    rho[~np.isfinite(distance)] = 0
    distance[~np.isfinite(distance)] = 0
    strength = np.stack([(rho * (echo == e)).sum(0) for e in range(7)])
    best = strength.argmax(0)
    weight = rho * (echo == best)
    total = weight.sum(0)
    hit = total > 0
    speaker = np.take_along_axis(order, weight.argmax(0)[None], 0)[0]
    scan.found[:] = hit
    scan.range_m[hit] = ((weight * distance).sum(0) / np.maximum(total, 1e-12))[hit]
    scan.intensity[:] = total / 7
    for sample, (surface, _) in enumerate(heard):
        rows = np.flatnonzero(hit & (speaker == sample))
        scan.material[rows], scan.instance[rows] = surface.material[rows], surface.instance[rows]
        scan.cos[rows], scan.rho[rows] = surface.cos[rows], scan.reflectance(scan.material, scan.instance)[rows]


def wet_road(scan: Scan, rng, film: float) -> None:
    road = scan.found & scan.table.road[scan.material]
    scan.intensity[road] *= 1 - film / 2
    bare = ((1.33 - 1) / (1.33 + 1)) ** 2
    fresnel = bare + (1 - bare) * (1 - scan.cos) ** 5
    gone = np.flatnonzero(road & (rng.random(len(road)) < film * fresnel))
    scan.found[gone] = False
    _mirror(scan, gone, scan.range_m, scan.solid.normal, _WET_PATH_M)


def glass_transmission(scan: Scan, rng, transmission: float, mode: str) -> None:
    glazed = scan.before_solid()
    scan.intensity[glazed] *= transmission**2
    echo = (1 - transmission) * scan.pane.cos
    if mode == "first":
        shown = glazed
    elif mode == "last":
        shown = glazed & ~scan.found
    else:
        shown = glazed & (~scan.found | (echo > scan.intensity))
    rows = np.flatnonzero(shown)
    rho = scan.reflectance(scan.pane.material[rows], scan.pane.instance[rows])
    scan.answer(rows, scan.pane.distance[rows], rho, echo[rows], scan.pane, rows)


def mirror_ghost(scan: Scan, rng, strength: float) -> None:
    chosen = rng.random(len(scan.found)) < strength
    glazed = scan.before_solid()
    metal = np.isfinite(scan.solid.distance) & scan.table.metal[scan.solid.material] & scan.found & ~glazed
    far = scan.beams.range_m[1]
    for rows, surface in ((glazed & chosen, scan.pane), (metal & chosen, scan.solid)):
        _mirror(scan, np.flatnonzero(rows), surface.distance.astype(float), surface.normal, far)


def _mirror(scan: Scan, rows, distance, normal, reach: float) -> None:
    """Beams `rows` return what they meet after a mirror; those that meet nothing are left as they are."""
    if not len(rows):
        return
    heading, facing = scan.direction[rows], normal[rows].astype(float)
    start = np.broadcast_to(scan.origin, scan.direction.shape)[rows] + distance[rows, None] * heading
    mirrored = heading - 2 * np.einsum("ij,ij->i", heading, facing)[:, None] * facing
    after = np.broadcast_to(scan.aim.after, scan.found.shape)[rows]
    seen, _ = scan.cast(start + 1e-3 * facing, mirrored, after, (0.0, reach))
    total = distance[rows] + seen.distance
    met = np.isfinite(seen.distance) & (total <= scan.beams.range_m[1])
    of = np.flatnonzero(met)
    rho = scan.reflectance(seen.material[of], seen.instance[of])
    scan.answer(rows[of], total[of], rho, rho, seen, of)

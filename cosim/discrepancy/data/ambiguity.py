"""Beams at edges: a touch aside they meet something else, so small errors of pose and footprint decide what."""

from __future__ import annotations

import numpy as np

from cosim.discrepancy.settings import Beams
from sensors.hits import Hits
from sensors.pattern import Pattern
from sensors.rays import Rays


class Neighbours:
    """Which beams stand beside each: the same ring before and after, and the rings above and below.

    Args:
        rays: ring-major.
        settings: numbers that decide.
        reach: how many firings to each side count.
    """

    def __init__(self, rays: Rays, settings: Beams, reach: int = 2) -> None:
        self._settings = settings
        bounds = np.searchsorted(rays.ring, np.arange(257))
        order = np.arange(len(rays))
        rows: list[np.ndarray] = []
        turn = _phase(rays)
        for aside in [s for k in range(1, reach + 1) for s in (-k, k)]:
            start, end = bounds[rays.ring], bounds[rays.ring.astype(int) + 1]
            rows.append(start + (order - start + aside) % (end - start))
        for step in (-1, 1):
            row = np.full(len(rays), -1)
            for ring in np.unique(rays.ring).tolist():
                mine = slice(bounds[ring], bounds[ring + 1])
                other = ring + step
                if not 0 <= other < 256 or bounds[other] == bounds[other + 1]:
                    continue
                theirs = turn[bounds[other] : bounds[other + 1]]
                at = np.searchsorted(theirs, turn[mine])
                best = np.stack([(at - 1) % len(theirs), at % len(theirs)])
                gap = np.abs(np.angle(np.exp(1j * (theirs[best] - turn[mine]))))
                row[mine] = bounds[other] + np.where(gap[0] <= gap[1], best[0], best[1])
            rows.append(row)
        self.rows = np.stack(rows)

    def at_edge(self, hits: Hits) -> tuple[np.ndarray, np.ndarray]:
        """Beams beside which the world does not go on as the plane they meet, and how near what is there stands.

        Where beams grazing a surface are concerned the plane's range is no use, so they count as edges too.

        Returns:
            (n,) bool; and (n,) range of the nearest surface by whose shift such an edge moves, also of a crease, whose
            two sides are apart by less than what makes an edge; infinite away from both.
        """
        solid, settings = hits.solid, self._settings
        rotation = hits.pose[:3, :3].astype(np.float32)
        direction = hits.rays.direction @ rotation.T
        origin = hits.rays.origin @ rotation.T
        normal = solid.normal
        offset = np.einsum("ij,ij->i", normal, origin + direction * np.where(solid.exists, solid.range_m, 0)[:, None])
        cos = np.abs(np.einsum("ij,ij->i", normal, direction))
        edge = solid.exists & (cos < settings.grazing)
        reach = np.where(solid.exists, solid.range_m, np.float32(np.inf))
        nearest = np.where(edge, reach, np.float32(np.inf))
        for row in self.rows:
            there = row >= 0
            other = np.where(there, row, 0)
            slope = np.einsum("ij,ij->i", normal, direction[other])
            foot = offset - np.einsum("ij,ij->i", normal, origin[other])
            with np.errstate(divide="ignore", invalid="ignore"):
                ahead = foot / slope
            found = solid.range_m[other]
            away = np.abs(found - ahead)
            jump = ~(away < settings.jump_m + settings.jump_share * found)
            differs = (solid.exists != solid.exists[other]) | (
                solid.exists & (jump | (solid.instance != solid.instance[other]))
            )
            differs &= there
            edge |= differs
            differs |= there & solid.exists & ~(away < settings.crease_m + settings.crease_share * found)
            nearest = np.where(differs, np.minimum(nearest, np.minimum(reach, reach[other])), nearest)
        return edge, nearest

    def at_border(self, hits: Hits) -> tuple[np.ndarray, np.ndarray]:
        """Beams beside which the surface is of another material, so that brightness may be either's, (n,) bool twice.

        Returns:
            Where a neighbour is so alike that nobody could tell which was met; where every one is clearly another.
        """
        material, reflectance = hits.solid.material, hits.reflectance(hits.solid)
        alike, apart = np.zeros(len(material), bool), np.zeros(len(material), bool)
        for row in self.rows:
            other = np.maximum(row, 0)
            differs = (row >= 0) & (material != material[other])
            clear = np.abs(reflectance - reflectance[other]) > self._settings.apart * np.maximum(
                reflectance, reflectance[other]
            )
            alike |= differs & ~clear
            apart |= differs & clear
        return alike, apart & ~alike


def widened(
    edge: np.ndarray, nearest_m: np.ndarray, pattern: Pattern, shift_m: float, turn_rad: float, settings: Beams
) -> np.ndarray:
    """(n,) bool: edges, and beams that would stand at one if what makes it were shifted and the sensor turned.

    Args:
        edge, nearest_m: (n,) of ring-major beams, see `Neighbours.at_edge`.
        pattern: of the beams.
        shift_m, turn_rad: how far.
        settings: numbers that decide.
    """
    rings, firings = pattern.rings, pattern.firings
    beside = np.isfinite(nearest_m)
    wide = (edge | beside).reshape(rings, firings)
    with np.errstate(divide="ignore"):
        angle = np.where(beside, shift_m / np.maximum(nearest_m, 0.5) + turn_rad, 0.0).reshape(rings, firings)
    aside = np.ceil(angle * firings / (2 * np.pi)).astype(int)
    for step in range(1, min(int(aside.max(initial=0)), settings.most_firings) + 1):
        far = aside >= step
        wide |= np.roll(far, step, 1) | np.roll(far, -step, 1)
    elevation = np.radians(np.array(pattern.elevation_deg))
    for step in range(1, min(rings, settings.most_rings + 1)):
        gap = np.abs(elevation[step:] - elevation[:-step])[:, None]
        far = angle[:-step] > gap
        wide[step:] |= far
        far = angle[step:] > gap
        wide[:-step] |= far
    return wide.ravel()


def _phase(rays: Rays) -> np.ndarray:
    """Azimuths rising within every ring (n,)."""
    fall = np.median(np.diff(rays.azimuth[: max(2, np.searchsorted(rays.ring, rays.ring[0], "right"))])) < 0
    return np.mod(np.pi - rays.azimuth if fall else rays.azimuth, 2 * np.pi)

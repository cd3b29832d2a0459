"""Ambiguous beams at edges: a beam in a slightly different direction would hit another surface."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from cosim.discrepancy.settings import BeamSampling
from sensors.hits import Hits
from sensors.pattern import Pattern
from sensors.rays import Rays


class Neighbours:
    """Neighbours of each beam: the previous and next firings of its ring, and the rings above and below.

    Args:
        rays: rays of the n beams, ring-major.
        settings: settings of the beams.
        reach: number of firings to each side.

    Attributes:
        rows: (2·reach + 2, n) int32 neighbours of each beam: previous 1, next 1, previous 2, …, above, below; −1: none.
    """

    def __init__(self, rays: Rays, settings: BeamSampling, reach: int = 2) -> None:
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
                own_beams = slice(bounds[ring], bounds[ring + 1])
                other = ring + step
                if not 0 <= other < 256 or bounds[other] == bounds[other + 1]:
                    continue
                other_turn = turn[bounds[other] : bounds[other + 1]]
                at = np.searchsorted(other_turn, turn[own_beams])
                best = np.stack([(at - 1) % len(other_turn), at % len(other_turn)])
                gap = np.abs(np.angle(np.exp(1j * (other_turn[best] - turn[own_beams]))))
                row[own_beams] = bounds[other] + np.where(gap[0] <= gap[1], best[0], best[1])
            rows.append(row)
        self.rows = np.stack(rows).astype(np.int32)

    def at_edge(self, hits: Hits) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Find beams whose neighbours do not hit the same plane, and the range of the nearest surface there.

        Beams at grazing incidence count as edges too, because the plane's range is then too sensitive.

        Returns:
            mask (n,) of edges; mask (n,) of beams at grazing incidence; and range (n,) [m] of the nearest surface at an
            edge or crease (an edge with a smaller step, which moves if one of its surfaces moves); infinite for others.
        """
        planes = _Planes(hits, self._settings)
        edge, reach = planes.grazed, planes.reach_m
        nearest = np.where(edge, reach, np.float32(np.inf))
        for row in self.rows:
            there = row >= 0
            other = np.where(there, row, 0)
            jump, crease = planes.end(slice(None), other)
            edge = edge | (there & jump)
            ends = there & (jump | crease)
            nearest = np.where(ends, np.minimum(nearest, np.minimum(reach, reach[other])), nearest)
        return edge, planes.grazed, nearest

    def next_to_sky(self, hits: Hits) -> np.ndarray:
        """Mask (n,) of beams that hit a surface and have a neighbour that hits none."""
        exists, found = hits.solid.exists, np.zeros(len(hits.solid), bool)
        for row in self.rows:
            found |= (row >= 0) & ~exists[np.maximum(row, 0)]
        return found & exists

    def other_sides(
        self, hits: Hits, beams: np.ndarray, shift_m: float, turn_rad: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Find what beams (k,) hit on the other side of an edge or crease if poses or objects have errors.

        The position of an edge is uniform between the last beam on one side and the first on the other. If there are
        several edges (or creases) next to a beam, the most probable is used.

        Args:
            hits: hits of all beams.
            beams: rows of the beams to test.
            shift_m, turn_rad: σ of shifts of the surfaces [m], and of rotations of the sensor [rad].

        Returns:
            (k, 2) neighbours that hit the other side of an edge and of a crease, −1 for none; and (k, 2) probabilities
            that the beam itself hits that side.
        """
        planes, settings = _Planes(hits, self._settings), self._settings
        side, chance = np.full((len(beams), 2), -1), np.zeros((len(beams), 2))
        before, after, above, below = self.rows[[0, 1, -2, -1]]
        for steps, most in ((before, settings.most_firings), (after, settings.most_firings),
                            (above, settings.most_rings), (below, settings.most_rings)):  # fmt: skip
            pending, at, near = np.arange(len(beams)), beams, np.zeros(len(beams))
            for _ in range(most):
                at = steps[at]
                pending, at, near = pending[at >= 0], at[at >= 0], near[at >= 0]
                own_beams = beams[pending]
                difference = planes.direction[own_beams] - planes.direction[at]
                far = np.linalg.norm(difference, axis=1)
                reach = np.maximum(np.minimum(planes.reach_m[own_beams], planes.reach_m[at]), 0.5)
                spread = np.maximum(np.hypot(shift_m / reach, turn_rad), 1e-9)
                jump, crease = planes.end(own_beams, at)
                probability = _exceedance(near / spread, far / spread)
                for kind, ends in enumerate((jump, crease & ~jump)):
                    is_better = ends & (probability > chance[pending, kind])
                    side[pending[is_better], kind], chance[pending[is_better], kind] = (
                        at[is_better],
                        probability[is_better],
                    )
                pending, at, near = pending[~jump], at[~jump], far[~jump]
        return side, chance

    def at_border(self, hits: Hits) -> tuple[np.ndarray, np.ndarray]:
        """Find beams with a neighbour of another material, so that their intensity is ambiguous.

        Returns:
            Mask (n,) of beams with a neighbour of similar reflectance; mask (n,) of beams whose neighbours of another
            material all differ clearly in reflectance.
        """
        material, reflectance = hits.solid.material, hits.reflectance(hits.solid)
        similar, apart = np.zeros(len(material), bool), np.zeros(len(material), bool)
        for row in self.rows:
            other = np.maximum(row, 0)
            differs = (row >= 0) & (material != material[other])
            clear = np.abs(reflectance - reflectance[other]) > self._settings.apart * np.maximum(
                reflectance, reflectance[other]
            )
            similar |= differs & ~clear
            apart |= differs & clear
        return similar, apart & ~similar


def widened(
    edge: np.ndarray, nearest_m: np.ndarray, pattern: Pattern, shift_m: float, turn_rad: float, settings: BeamSampling
) -> np.ndarray:
    """Widen edges by possible errors: mask (n,) of beams that are at an edge, or would be after a shift and rotation.

    Args:
        edge, nearest_m: (n,) values of ring-major beams, see `Neighbours.at_edge`.
        pattern: pattern of the beams.
        shift_m, turn_rad: shift of the surfaces [m] and rotation of the sensor [rad].
        settings: settings of the beams.
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


class _Planes:
    """Planes that the beams of a scan hit, in world axes relative to the LiDAR.

    Attributes:
        direction: (n, 3) directions of the beams.
        reach_m: (n,) range [m]; infinite for misses.
        grazed: (n,) bool whether the beam is nearly parallel to its plane.
    """

    def __init__(self, hits: Hits, settings: BeamSampling) -> None:
        rotation = hits.pose[:3, :3].astype(np.float32)
        self._solid, self._settings, self._normal = hits.solid, settings, hits.solid.normal
        self._exists = hits.solid.exists
        self.direction, self._origin = hits.rays.direction @ rotation.T, hits.rays.origin @ rotation.T
        point = self._origin + self.direction * np.where(self._exists, hits.solid.range_m, 0)[:, None]
        self._offset = np.einsum("ij,ij->i", self._normal, point)
        self.reach_m = np.where(self._exists, hits.solid.range_m, np.float32(np.inf))
        self.grazed = self._exists & (np.abs(np.einsum("ij,ij->i", self._normal, self.direction)) < settings.grazing)

    def end(self, beams: np.ndarray | slice, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Masks (k,) of pairs of beams (k,) with an edge between them, and with a crease or edge between them."""
        solid, by, normal, exists = self._solid, self._settings, self._normal[beams], self._exists[beams]
        slope = np.einsum("ij,ij->i", normal, self.direction[other])
        foot = self._offset[beams] - np.einsum("ij,ij->i", normal, self._origin[other])
        range_m = solid.range_m[other]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.abs(range_m - foot / slope)
        jump = ~(distance < by.jump_m + by.jump_share * range_m) | (solid.instance[beams] != solid.instance[other])
        crease = exists & ~(distance < by.crease_m + by.crease_share * range_m)
        return (exists != self._exists[other]) | (exists & jump), crease


def _exceedance(near: np.ndarray, far: np.ndarray) -> np.ndarray:
    """Probability (k,) that a standard normal variable exceeds a limit that is uniform in [`near`, `far`] (k,)."""

    def below(z: np.ndarray) -> np.ndarray:  # antiderivative of P(Z > z)
        return z * ndtr(-z) - np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)

    return (below(far) - below(near)) / (far - near)


def _phase(rays: Rays) -> np.ndarray:
    """(n,) azimuths [rad] that increase within each ring."""
    fall = np.median(np.diff(rays.azimuth[: max(2, np.searchsorted(rays.ring, rays.ring[0], "right"))])) < 0
    return np.mod(np.pi - rays.azimuth if fall else rays.azimuth, 2 * np.pi)

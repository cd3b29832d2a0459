"""Beams at edges: a touch aside they meet something else, so small errors of pose and footprint decide what."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

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

    def at_edge(self, hits: Hits) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Beams beside which the world does not go on as the plane they meet, and how near what is there stands.

        Where beams grazing a surface are concerned the plane's range is no use, so they count as edges too.

        Returns:
            (n,) bool; which of them graze (n,) bool; and (n,) range of the nearest surface by whose shift such an edge
            moves, also of a crease, whose two sides are apart by less than what makes an edge; infinite away from both.
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

    def other_sides(
        self, hits: Hits, beams: np.ndarray, shift_m: float, turn_rad: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """What some beams (k,) meet if poses and objects are so far off that they come to lie beyond an edge.

        An edge stands anywhere between a beam that meets one side and the next one, which meets the other. Of all edges
        beside a beam that counts which it is likeliest beyond, and so of creases.

        Args:
            hits: of all beams.
            beams: rows of those that are asked for.
            shift_m, turn_rad: standard deviations of shifts of what makes an edge, and of turns of the sensor.

        Returns:
            (k, 2) the beams next to each that meet the other side of an edge and of a crease, −1 for none; and how
            likely it is that the beam itself meets that, (k, 2).
        """
        planes, settings = _Planes(hits, self._settings), self._settings
        side, chance = np.full((len(beams), 2), -1), np.zeros((len(beams), 2))
        before, after, above, below = self.rows[[0, 1, -2, -1]]
        for steps, most in ((before, settings.most_firings), (after, settings.most_firings),
                            (above, settings.most_rings), (below, settings.most_rings)):  # fmt: skip
            left, at, near = np.arange(len(beams)), beams, np.zeros(len(beams))
            for _ in range(most):
                at = steps[at]
                left, at, near = left[at >= 0], at[at >= 0], near[at >= 0]
                mine = beams[left]
                away = planes.direction[mine] - planes.direction[at]
                far = np.linalg.norm(away, axis=1)
                reach = np.maximum(np.minimum(planes.reach_m[mine], planes.reach_m[at]), 0.5)
                spread = np.maximum(np.hypot(shift_m / reach, turn_rad), 1e-9)
                jump, crease = planes.end(mine, at)
                likely = _beyond(near / spread, far / spread)
                for kind, ends in enumerate((jump, crease & ~jump)):
                    more = ends & (likely > chance[left, kind])
                    side[left[more], kind], chance[left[more], kind] = at[more], likely[more]
                left, at, near = left[~jump], at[~jump], far[~jump]
        return side, chance

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


class _Planes:
    """The planes that beams of a scan meet, in world axes about its middle.

    Attributes:
        direction: (n, 3) of the beams.
        reach_m: (n,) range; infinite where nothing is met.
        grazed: (n,) bool: whether a beam runs along its plane rather than to it.
    """

    def __init__(self, hits: Hits, settings: Beams) -> None:
        rotation = hits.pose[:3, :3].astype(np.float32)
        self._solid, self._settings, self._normal = hits.solid, settings, hits.solid.normal
        self._exists = hits.solid.exists
        self.direction, self._origin = hits.rays.direction @ rotation.T, hits.rays.origin @ rotation.T
        point = self._origin + self.direction * np.where(self._exists, hits.solid.range_m, 0)[:, None]
        self._offset = np.einsum("ij,ij->i", self._normal, point)
        self.reach_m = np.where(self._exists, hits.solid.range_m, np.float32(np.inf))
        self.grazed = self._exists & (np.abs(np.einsum("ij,ij->i", self._normal, self.direction)) < settings.grazing)

    def end(self, beams: np.ndarray | slice, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k,) bool twice: whether planes of some beams do not go on to others (k,), by far and by little."""
        solid, by, normal, exists = self._solid, self._settings, self._normal[beams], self._exists[beams]
        slope = np.einsum("ij,ij->i", normal, self.direction[other])
        foot = self._offset[beams] - np.einsum("ij,ij->i", normal, self._origin[other])
        found = solid.range_m[other]
        with np.errstate(divide="ignore", invalid="ignore"):
            away = np.abs(found - foot / slope)
        jump = ~(away < by.jump_m + by.jump_share * found) | (solid.instance[beams] != solid.instance[other])
        crease = exists & ~(away < by.crease_m + by.crease_share * found)
        return (exists != self._exists[other]) | (exists & jump), crease


def _beyond(near: np.ndarray, far: np.ndarray) -> np.ndarray:
    """Chance (k,) that a normal deviate is beyond what stands anywhere between `near` and `far` (k,)."""

    def below(z: np.ndarray) -> np.ndarray:  # its slope is the chance of a deviate beyond z
        return z * ndtr(-z) - np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)

    return (below(far) - below(near)) / (far - near)


def _phase(rays: Rays) -> np.ndarray:
    """Azimuths rising within every ring (n,)."""
    fall = np.median(np.diff(rays.azimuth[: max(2, np.searchsorted(rays.ring, rays.ring[0], "right"))])) < 0
    return np.mod(np.pi - rays.azimuth if fall else rays.azimuth, 2 * np.pi)

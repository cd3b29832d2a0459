"""Divides the street fronts into plots, each with a footprint that touches no street and no neighbour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Geometry

from assets.world.styles import TownStyle

_CLEAR_OF_STREET_M = 0.2
_CLEAR_OF_OPEN_ROAD_M = 15.0
_WALK_M = 2.0  # step along the front after a footprint found no room
_SMALL_ISLAND_M2 = 900.0  # land within a roundabout or between carriageways, without buildings
_MEADOW_M = (40.0, 120.0)  # frontage of open land between groups of houses


@dataclass(frozen=True, eq=False)
class BuildingPlot:
    """A piece of street front and the building on it.

    Attributes:
        front: (2,) middle of the plot at the pavement's edge, world metres.
        along: (2,) unit vector along the street; the land lies to its left.
        width_m: plot width along the street.
        setback_m: from the pavement's edge to the façade.
        size_m: building extent along and away from the street.
    """

    front: np.ndarray
    along: np.ndarray
    width_m: float
    setback_m: float
    size_m: tuple[float, float]

    @property
    def inward(self) -> np.ndarray:
        """Unit vector (2,) away from the street."""
        return np.array([-self.along[1], self.along[0]])

    @property
    def centre(self) -> np.ndarray:
        """Middle (2,) of the footprint."""
        return self.front + self.inward * (self.setback_m + self.size_m[1] / 2)

    @property
    def heading_rad(self) -> float:
        """Direction of `along`, counter-clockwise from east."""
        return float(np.arctan2(self.along[1], self.along[0]))

    def corners(self, margin_m: float = 0.0) -> np.ndarray:
        """Footprint corners (4, 2), counter-clockwise, the first two at the street."""
        half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (np.array(self.size_m) / 2 + margin_m)
        return self.centre + half[:, :1] * self.along + half[:, 1:] * self.inward


def lay_out(
    paved: Geometry, style: TownStyle, rng: np.random.Generator, open_roads: Geometry | None = None
) -> list[BuildingPlot]:
    """Plots along every edge of the paved area, in order along the streets; none along open roads."""
    blocked = shapely.buffer(paved, _CLEAR_OF_STREET_M, quad_segs=2)
    if open_roads is not None:
        blocked = shapely.union(blocked, shapely.buffer(open_roads, _CLEAR_OF_OPEN_ROAD_M, quad_segs=4))
    shapely.prepare(blocked)
    placed = _Footprints(blocked)
    plots: list[BuildingPlot] = []
    for ring in land_on_left(paved):
        plots.extend(_along_ring(ring, style, placed, rng))
    return plots


class _Footprints:
    """Footprints so far, for collision checks."""

    def __init__(self, blocked: Geometry) -> None:
        self._blocked = blocked
        self._centres = np.zeros((0, 3))  # x, y, circumradius
        self._shapes: list[Geometry] = []

    def take(self, plot: BuildingPlot, gap_m: float) -> bool:
        """Reserves the plot's footprint if it is free."""
        shape = shapely.Polygon(plot.corners())
        if shapely.intersects(self._blocked, shape):
            return False
        radius = np.hypot(*plot.size_m) / 2
        near = np.linalg.norm(self._centres[:, :2] - plot.centre, axis=1) < self._centres[:, 2] + radius + gap_m
        others = [self._shapes[i] for i in np.flatnonzero(near)]
        if others and shapely.distance(shape, others).min() < gap_m:
            return False
        self._centres = np.concatenate([self._centres, [[*plot.centre, radius]]])
        self._shapes.append(shape)
        return True


def land_on_left(paved: Geometry, least_m2: float = _SMALL_ISLAND_M2) -> list[np.ndarray]:
    """Rings (k, 2) of the paved area, closed, with the unpaved land on their left; no islands below `least_m2`."""
    rings = []
    for polygon in shapely.get_parts(paved):
        for k, ring in enumerate((polygon.exterior, *polygon.interiors)):
            if k > 0 and shapely.Polygon(ring).area < least_m2:
                continue
            simple = shapely.get_coordinates(shapely.simplify(ring, 0.25))
            if shapely.is_ccw(shapely.linearrings(simple)) != (k > 0):
                simple = simple[::-1]
            rings.append(simple)
    return rings


def _along_ring(
    ring: np.ndarray, style: TownStyle, placed: _Footprints, rng: np.random.Generator
) -> list[BuildingPlot]:
    """Walks along a ring and puts a building wherever one fits."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    plots: list[BuildingPlot] = []
    station = float(rng.uniform(0.0, 3.0))
    while station < along[-1]:
        if rng.random() < style.gap_share * 0.6:
            station += rng.uniform(8.0, 20.0)
        if rng.random() < style.meadow_chance:
            station += rng.uniform(*_MEADOW_M)
        gap = rng.uniform(*style.side_gap_m)
        front = min(rng.uniform(*style.front_m), along[-1] * 0.3)
        size = (front, rng.uniform(*style.depth_m))
        setback = rng.uniform(*style.setback_m)
        for shrink in (1.0, 0.75, 0.55):
            width = size[0] * shrink + gap
            ends = np.array([station, station + width]) % along[-1]
            start, end = np.stack([np.interp(ends, along, ring[:, k]) for k in (0, 1)], axis=1)
            chord = end - start
            length = float(np.linalg.norm(chord))
            if length < 0.97 * width:
                continue
            depth = size[1] * max(shrink, 0.65)
            plot = BuildingPlot((start + end) / 2, chord / length, width, setback, (size[0] * shrink, depth))
            if placed.take(plot, min(gap, 2.0)):
                plots.append(plot)
                station += width
                break
        else:
            station += _WALK_M
    return plots

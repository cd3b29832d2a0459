"""Occupied areas: props are placed neither on roads and walking lines nor in houses or other props."""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import KDTree
from shapely import Geometry, STRtree

from assets.streets import Streets
from assets.world import polylines
from assets.world.buildings.given import outline_polygon
from assets.world.buildings.plots import BuildingPlot
from assets.world.roads.surfaces import Outlines

_WALKING_LINE_M = 0.45  # kept free on either side of a sidewalk's centre line
_CROSSING_M = 1.2  # kept free around crossings
_DECK_M = 2.5  # kept free beside bridges, for crowns of trees


class Obstacles:
    """Checks positions of props and stores placed ones."""

    def __init__(
        self, streets: Streets, outlines: Outlines, paved: Geometry, plots: list[BuildingPlot], decks: Geometry
    ) -> None:
        """Collects the fixed obstacles of a town; `paved` is the whole of its outlines, `decks` those of bridges."""
        self._decks = decks
        self._carriageway = outlines.carriageway
        self._paved = paved
        self._crossings = outlines.crossings
        shapely.prepare([self._carriageway, self._paved, self._crossings, self._decks])
        given = [outline_polygon(building) for building in streets.buildings]
        self._houses = STRtree([*(shapely.Polygon(plot.corners()) for plot in plots), *given])
        lines = [lane.centre for lane in streets.lanes if lane.use == "sidewalk"]
        walked = [polylines.at(line, np.arange(0.0, polylines.stations(line)[-1], 0.4)) for line in lines]
        self._walked = KDTree(np.concatenate(walked)) if walked else None
        self._taken = np.zeros((0, 3))  # x, y, radius

    def free(
        self,
        xy: np.ndarray,
        radius_m: float,
        road_m: float = 0.15,
        paved_m: float | None = None,
        *,
        fits_below_decks: bool = False,
    ) -> np.ndarray:
        """Whether a prop of `radius_m` may be at points `xy` (n, 2); earlier props are ignored.

        Args:
            xy: world points.
            radius_m: distance to keep from houses.
            road_m: distance to keep from the carriageway.
            paved_m: distance to keep from any paved ground, for plants; None allows pavement.
            fits_below_decks: whether the prop is lower than the decks of bridges.
        """
        points = shapely.points(xy)
        ok = ~np.asarray(shapely.dwithin(self._carriageway, points, road_m))
        if not shapely.is_empty(self._crossings):
            ok &= ~np.asarray(shapely.dwithin(self._crossings, points, _CROSSING_M))
        if paved_m is not None:
            ok &= ~np.asarray(shapely.dwithin(self._paved, points, paved_m))
        ok[self._houses.query(points, predicate="dwithin", distance=radius_m)[0]] = False
        if not fits_below_decks:
            ok &= ~self.lies_below_deck(xy)
        if self._walked is not None:
            ok &= self._walked.query(xy)[0] > _WALKING_LINE_M
        return ok

    def lies_below_deck(self, xy: np.ndarray) -> np.ndarray:
        """Whether points (n, 2) lie below or close to the deck of a bridge."""
        if shapely.is_empty(self._decks):
            return np.zeros(len(xy), bool)
        return np.asarray(shapely.dwithin(self._decks, shapely.points(xy), _DECK_M))

    def take(self, xy: np.ndarray, radius_m: float, most: int | None = None) -> np.ndarray:
        """Reserves points (n, 2) in order, `most` at most; false where an earlier prop is too near."""
        taken = np.zeros(len(xy), bool)
        for i, point in enumerate(xy):
            if most is not None and taken.sum() >= most:
                break
            reach = self._taken[:, 2] + radius_m
            if (((self._taken[:, :2] - point) ** 2).sum(1) >= reach**2).all():
                self._taken = np.concatenate([self._taken, [[*point, radius_m]]])
                taken[i] = True
        return taken

    def crosses(self, start: np.ndarray, end: np.ndarray, clear_m: float = 0.1) -> np.ndarray:
        """Whether segments from `start` to `end` (n, 2) come within `clear_m` of a house or paved ground."""
        segments = shapely.linestrings(np.stack([start, end], axis=1))
        hit = np.asarray(shapely.dwithin(self._paved, segments, clear_m))
        hit[self._houses.query(segments, predicate="dwithin", distance=clear_m)[0]] = True
        return hit

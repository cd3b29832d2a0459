"""Closes open street fronts: hedges, walls and hedgerows with trees, with gateways between them."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import Geometry, STRtree

from assets.streets import Streets
from assets.world import polylines
from assets.world.borders.fences import PIECE_M, TALL_KINDS
from assets.world.borders.gardens import Borders
from assets.world.buildings.houses import House
from assets.world.buildings.plots import land_on_left
from assets.world.obstacles import Obstacles
from assets.world.roads.surfaces import Outlines, crossroads, open_roads
from assets.world.styles import TownStyle

_RUN_M = (12.0, 48.0)  # length of one kind and height
_GATEWAY_M = (3.0, 5.0)
_GATEWAY_SHARE = 0.6  # of runs that end at a driveway
_RISE = (0.85, 1.25)
_SET_BACK_M = {"walked": (0.7, 2.6), "bare": (1.6, 3.0), "fast": (4.5, 8.0)}  # from the edge of what is paved
_SIGHT_M = 4.0  # around crossroads borders are low, for drivers' sight
_LOW = 0.6  # of the usual height, there
_CROSSING_M = 1.5  # kept open around crossings
_PATH_M = 1.3  # kept open next to garden paths
_HOUSE_M = 2.6  # no border before a façade nearer than this
_BEHIND_M = 7.0  # one border is enough within this depth
_SMALL_ISLAND_M2 = 250.0
_STRIP_M = 14.0  # land between roads narrower than this is planted, never walled
_TREES_SHARE = 0.35  # of hedges with a row of trees behind them
_TREE_M = 9.0


def enclose(
    streets: Streets, outlines: Outlines, houses: list[House], gardens: Borders, blocked: Obstacles, style: TownStyle,
    rng: np.random.Generator,
) -> tuple[Borders, np.ndarray]:  # fmt: skip
    """Borders along street fronts that neither houses nor garden borders close, and spots (n, 2) of trees behind."""
    corners = shapely.buffer(crossroads(streets, outlines.carriageway), _SIGHT_M)
    keep_open = shapely.union_all([shapely.buffer(outlines.crossings, _CROSSING_M), _paths(houses)])
    shapely.prepare([corners, keep_open, outlines.pavement])
    footprints = STRtree([shapely.Polygon(house.plot.corners()) for house in houses])
    fast = open_roads(streets)
    tall = gardens.only(np.isin(gardens.kind, TALL_KINDS))
    standing = [shapely.LineString(ends) for ends in zip(tall.start, tall.end, strict=True)]
    lines, trees = [], []
    for ring in land_on_left(outlines.paved, _SMALL_ISLAND_M2):
        length = polylines.stations(ring)[-1]
        strip = 2.0 * shapely.Polygon(ring).area / length < _STRIP_M
        station = float(rng.uniform(0.0, 5.0))
        while station < length - 4.0:
            run = min(float(rng.uniform(*_RUN_M)), length - station)
            kind, rise = str(rng.choice(style.enclosures)), float(rng.uniform(*_RISE))
            kind = "hedge" if strip else kind
            closed, rows = rng.random() < style.enclosed, kind == "hedge" and rng.random() < _TREES_SHARE
            share, turn = rng.random(), rng.random()
            if closed:
                stations = np.linspace(station, station + run, max(1, round(run / PIECE_M[kind])) + 1)
                knots, inward = _set_back(ring, stations, outlines, fast, share)
                open_here = _open(knots, inward, footprints, STRtree(standing), keep_open)
                open_here &= ~blocked.crosses(knots[:-1], knots[1:])
                for i in np.flatnonzero(open_here):
                    piece = shapely.LineString(knots[i : i + 2])
                    lines.append((kind, knots[i : i + 2], _LOW if shapely.intersects(corners, piece) else rise))
                    standing.append(piece)
                if rows:
                    spots = (knots + 1.7 * inward)[:-1][open_here]
                    trees.append(spots[int(turn * 2) :: max(1, round(_TREE_M / PIECE_M[kind]))])
            station += run + (float(rng.uniform(*_GATEWAY_M)) if rng.random() < _GATEWAY_SHARE else 0.0)
    return Borders.of(lines), np.concatenate([np.zeros((0, 2)), *trees])


def _paths(houses: list[House]) -> Geometry:
    """The ways from the pavement to the doors, and room on either side."""
    gate = np.array([house.plot.front + house.plot.along * house.door_m for house in houses]).reshape(-1, 2)
    inward = np.array([house.plot.inward * house.plot.setback_m for house in houses]).reshape(-1, 2)
    return shapely.union_all(shapely.linestrings(np.stack([gate, gate + inward], axis=1))).buffer(_PATH_M)


def _set_back(
    ring: np.ndarray, stations: np.ndarray, outlines: Outlines, fast: Geometry, share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 2) next to the paved edge at `stations`, and unit vectors (k, 2) away from it."""
    edge = polylines.at(ring, stations)
    end = polylines.stations(ring)[-1]
    chord = polylines.at(ring, np.minimum(stations + 2.0, end)) - polylines.at(ring, np.maximum(stations - 2.0, 0.0))
    ahead = chord / np.maximum(np.linalg.norm(chord, axis=1, keepdims=True), 1e-6)
    inward = ahead[:, ::-1] * [-1.0, 1.0]
    outside = edge - 0.4 * inward
    walked = shapely.contains_xy(outlines.pavement, outside[:, 0], outside[:, 1]).mean() > 0.5
    rural = shapely.dwithin(fast, shapely.points(edge), 4.0).mean() > 0.5
    low, high = _SET_BACK_M["fast" if rural else "walked" if walked else "bare"]
    return edge + (low + share * (high - low)) * inward, inward


def _open(
    knots: np.ndarray, inward: np.ndarray, footprints: STRtree, standing: STRtree, keep_open: Geometry
) -> np.ndarray:
    """(k − 1,) bool pieces between the knots that close an open front."""
    pieces = shapely.linestrings(np.stack([knots[:-1], knots[1:]], axis=1))
    middle, away = (knots[:-1] + knots[1:]) / 2, (inward[:-1] + inward[1:]) / 2
    length = np.linalg.norm(knots[1:] - knots[:-1], axis=1)
    nominal = np.median(length)
    ok = (length > 0.5 * nominal) & (length < 1.5 * nominal) & ~shapely.intersects(keep_open, pieces)
    ok[footprints.query(pieces, predicate="dwithin", distance=_HOUSE_M)[0]] = False
    probe = shapely.linestrings(np.stack([middle - 1.5 * away, middle + _BEHIND_M * away], axis=1))
    ok[standing.query(probe, predicate="intersects")[0]] = False
    return ok

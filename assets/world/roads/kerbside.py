"""Stations along the edge of the carriageway for street furniture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from assets.streets import Streets
from assets.world import polylines
from assets.world.roads.surfaces import Outlines, crossroads

_STEP_M = 1.0
_WIDEST_PAVEMENT_M = 6.0


@dataclass(frozen=True, eq=False)
class Kerbside:
    """Points every metre along the carriageway's edge.

    Attributes:
        point: (n, 2) world metres.
        outward: (n, 2) unit vector away from the road.
        run: (n,) number of the edge line a point belongs to.
        pavement_m: (n,) width of the pavement behind the kerb; 0 where there is none.
        junction_m: (n,) distance to the nearest junction or crossing.
    """

    point: np.ndarray
    outward: np.ndarray
    run: np.ndarray
    pavement_m: np.ndarray
    junction_m: np.ndarray

    @property
    def yaw_rad(self) -> np.ndarray:
        """Heading (n,) of furniture whose y axis faces the road."""
        return np.arctan2(-self.outward[:, 1], -self.outward[:, 0]) - np.pi / 2

    def spots(self, setback_m: np.ndarray | float) -> np.ndarray:
        """Points (n, 2) `setback_m` behind the kerb."""
        return self.point + self.outward * np.broadcast_to(setback_m, len(self.point))[:, None]

    def every(self, gap_m: float, rng: np.random.Generator) -> np.ndarray:
        """Rows about `gap_m` apart along each line, each line from a random start."""
        rows = []
        for run in range(int(self.run.max()) + 1 if len(self.run) else 0):
            members = np.flatnonzero(self.run == run)
            rows.append(members[int(rng.uniform(0, gap_m)) :: max(1, round(gap_m))])
        return np.concatenate(rows) if rows else np.zeros(0, int)


def kerbside(streets: Streets, outlines: Outlines) -> Kerbside:
    """Samples the edge of the carriageway."""
    points, outward, run = [], [], []
    rings = shapely.get_parts(shapely.get_rings(shapely.get_parts(outlines.carriageway)))
    shapely.prepare([outlines.carriageway, outlines.pavement])
    for number, ring in enumerate(rings):
        line = shapely.get_coordinates(ring)
        station = np.arange(0.5, polylines.stations(line)[-1], _STEP_M)
        point, ahead = polylines.at(line, station), polylines.headings(line, station)
        left = ahead[:, ::-1] * [-1.0, 1.0]
        probe = point + 0.2 * left
        inside = shapely.contains_xy(outlines.carriageway, probe[:, 0], probe[:, 1])
        points.append(point)
        outward.append(np.where(inside[:, None], -left, left))
        run.append(np.full(len(point), number))
    point, normal = np.concatenate(points), np.concatenate(outward)
    knot = shapely.union_all([crossroads(streets, outlines.carriageway), outlines.crossings])
    away = np.full(len(point), 1e3)
    if not knot.is_empty:
        shapely.prepare(knot)
        away = np.asarray(shapely.distance(knot, shapely.points(point)))
    return Kerbside(point, normal, np.concatenate(run), _pavement_width(point, normal, outlines), away)


def _pavement_width(point: np.ndarray, outward: np.ndarray, outlines: Outlines) -> np.ndarray:
    """Metres of pavement straight behind each kerb point, to a quarter of a metre."""
    steps = np.arange(0.15, _WIDEST_PAVEMENT_M, 0.25)
    probe = point[:, None] + outward[:, None] * steps[:, None]
    paved = shapely.contains_xy(outlines.pavement, probe[..., 0], probe[..., 1])
    return np.where(paved.all(1), steps[-1], steps[np.argmin(paved, axis=1)] - 0.15)

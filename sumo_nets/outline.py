"""Repair of self-intersecting outlines from netconvert."""

from __future__ import annotations

import numpy as np
import shapely

_SAME_POINT_M = 0.03
_SPECK_M2 = 0.05


def simple_outlines(points: np.ndarray) -> list[np.ndarray]:
    """Return the outline, (k, 3) and not closed, as polygons that do not cross themselves, largest first.

    A self-intersecting outline is split into pieces; tiny pieces are left out. Corners that are new take their
    height from the outline they lie on.
    """
    outline = _without_repeats(points)
    if len(outline) < 3:
        return []
    polygon = shapely.Polygon(outline[:, :2])
    if polygon.is_valid:
        return [outline]
    pieces = shapely.get_parts(shapely.get_parts(shapely.make_valid(polygon)))  # collections may hold several polygons
    parts = [part for part in pieces if isinstance(part, shapely.Polygon) and part.area > _SPECK_M2]
    parts.sort(key=lambda part: -part.area)
    corners = [_without_repeats(np.array(part.exterior.coords)) for part in parts]
    return [np.column_stack([xy, _heights(outline, xy)]) for xy in corners if len(xy) >= 3]


def _without_repeats(points: np.ndarray) -> np.ndarray:
    kept: list[np.ndarray] = []
    for point in points:
        if not kept or np.linalg.norm(point[:2] - kept[-1][:2]) > _SAME_POINT_M:
            kept.append(point)
    while len(kept) > 1 and np.linalg.norm(kept[-1][:2] - kept[0][:2]) <= _SAME_POINT_M:
        kept.pop()
    return np.array(kept)


def _heights(outline: np.ndarray, xy: np.ndarray) -> np.ndarray:
    closed = np.vstack([outline, outline[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed[:, :2], axis=0), axis=1))])
    ring = shapely.LineString(closed[:, :2])
    return np.interp([ring.project(shapely.Point(p)) for p in xy], along, closed[:, 2])

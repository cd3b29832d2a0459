"""Tram tracks: rails along lanes, and a bed of gravel on lanes only for trams."""

from __future__ import annotations

import numpy as np
import shapely

from assets.mesh import Mesh
from assets.streets import StreetLane, Streets
from assets.world import polylines
from assets.world.ground.overlays import Heights, ribbons

GAUGE_M = 1.435  # between the inner faces of the rails
RAIL_M = 0.067  # width of a rail's head
_RAIL_RISE_M, _BED_RISE_M = 0.005, 0.003
_BED_M = 2.5
_STEP_M = 2.0


def tracks_mesh(streets: Streets, height: Heights) -> Mesh:
    """Two steel ribbons, 1.435 m apart, along every lane with tracks; street-running lanes keep their asphalt."""
    tracked = [lane for lane in streets.lanes if lane.tracks]
    if not tracked:
        return Mesh.empty()
    aside = (GAUGE_M + RAIL_M) / 2
    rails = [polylines.solid(polylines.offset(_fine(lane), side * aside)) for lane in tracked for side in (-1.0, 1.0)]
    return Mesh.merge(
        [
            _ribbons(rails, RAIL_M, height, _RAIL_RISE_M, "rail"),
            _ribbons(_beds(streets, tracked), _BED_M, height, _BED_RISE_M, "gravel"),
        ]
    )


def _fine(lane: StreetLane) -> np.ndarray:
    """The centre line (k, 2) with points at most 2 m apart."""
    total = float(polylines.stations(lane.centre)[-1])
    return polylines.at(lane.centre, np.linspace(0.0, total, max(2, int(np.ceil(total / _STEP_M)) + 1)))


def _beds(streets: Streets, tracked: list[StreetLane]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Starts and ends of the parts of tram lanes that no road crosses."""
    roads = [
        shapely.buffer(shapely.LineString(lane.centre[:, :2]), (lane.width_m + _BED_M) / 2, cap_style="flat")
        for lane in streets.lanes
        if lane.use != "tram"
    ]
    paved = shapely.union_all(roads)
    shapely.prepare(paved)
    beds = []
    for lane in tracked:
        if lane.use == "tram":
            start, end = polylines.solid(_fine(lane))
            middle = (start + end) / 2
            free = ~shapely.contains_xy(paved, middle[:, 0], middle[:, 1])
            beds.append((start[free], end[free]))
    return beds


def _ribbons(
    pieces: list[tuple[np.ndarray, np.ndarray]], width_m: float, height: Heights, rise_m: float, material: str
) -> Mesh:
    if not pieces:
        return Mesh.empty()
    start, end = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return ribbons(start, end, width_m, lambda xy: height(xy) + rise_m, material)

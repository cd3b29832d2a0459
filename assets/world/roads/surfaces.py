"""Outlines of what is paved: carriageway and pavement as clean polygons."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Geometry

from assets.streets import LaneUse, Streets

_GAP_M = 0.7  # narrower gaps between paved parts are paved over
_SPIKE_M = 0.15
_SMALL_HOLE_M2 = 12.0
_PRECISION_M = 0.01
_FAST_MPS = 18.0
_ARM_M = 3.0  # roads are counted this far outside a junction


@dataclass(frozen=True)
class Outlines:
    """Paved areas in world metres, each a valid (multi)polygon, disjoint but touching.

    Attributes:
        carriageway: drive, cycle and tram lanes, junctions, crossings, parking bays.
        pavement: sidewalks and walking areas outside the carriageway.
        crossings: zebra crossings, part of the carriageway.
        parking: parking bays, part of the carriageway.
    """

    carriageway: Geometry
    pavement: Geometry
    crossings: Geometry
    parking: Geometry

    @property
    def paved(self) -> Geometry:
        """Carriageway and pavement together."""
        return _polygons_only(shapely.union(self.carriageway, self.pavement, grid_size=_PRECISION_M))


def outline(streets: Streets) -> Outlines:
    """Unites lanes, junctions and bays of a network into clean outlines."""
    crossings = shapely.union_all(_strips(streets, ("crossing",)))
    parking = shapely.union_all([_strip(bay.centre, bay.width_m) for bay in streets.parking] or [shapely.Polygon()])
    drivable = [*_strips(streets, ("drive", "cycle", "tram")), *_areas(streets, "junction"), crossings, parking]
    walkable = [*_strips(streets, ("sidewalk",)), *_areas(streets, "walkingarea")]
    carriageway = _clean(_closed(shapely.union_all(drivable, grid_size=_PRECISION_M)))
    paved = _closed(shapely.union_all([carriageway, *walkable], grid_size=_PRECISION_M))
    paved = _polygons_only(shapely.union(_clean(paved), carriageway, grid_size=_PRECISION_M))
    pavement = _opened(shapely.difference(paved, carriageway, grid_size=_PRECISION_M))
    return Outlines(carriageway, _polygons_only(pavement), crossings, parking)


def open_roads(streets: Streets) -> Geometry:
    """Lanes of fast roads and, in a town with sidewalks, of roads without: there are no houses along them."""
    walked = {lane.edge for lane in streets.lanes if lane.use == "sidewalk"}
    lanes = [lane for lane in streets.lanes if lane.use == "drive" and not lane.internal]
    bare = {lane.edge for lane in lanes} - walked
    if len(bare) > len(walked):
        bare = set()
    fast = [lane for lane in lanes if lane.edge in bare or (lane.speed_mps > _FAST_MPS and lane.edge not in walked)]
    return shapely.union_all([_strip(lane.centre, lane.width_m) for lane in fast])


def crossroads(streets: Streets, carriageway: Geometry) -> Geometry:
    """Junctions of three roads or more; bends and turning places are junctions only in the network."""
    meeting = []
    for junction in _areas(streets, "junction"):
        around = shapely.get_rings(shapely.get_parts(shapely.buffer(junction, _ARM_M)))
        arms = shapely.intersection(shapely.union_all(around), carriageway)
        if len(shapely.get_parts(shapely.line_merge(arms))) > 2:
            meeting.append(junction)
    return shapely.union_all(meeting)


def _strips(streets: Streets, uses: tuple[LaneUse, ...]) -> list[Geometry]:
    return [_strip(lane.centre, lane.width_m) for lane in streets.lanes if lane.use in uses]


def _strip(centre: np.ndarray, width_m: float) -> Geometry:
    line = shapely.LineString(centre[:, :2])
    return shapely.buffer(line, width_m / 2, cap_style="flat", join_style="mitre", mitre_limit=2.0)


def _areas(streets: Streets, use: str) -> list[Geometry]:
    shapes = [shapely.Polygon(area.outline[:, :2]) for area in streets.areas if area.use == use]
    return [shapely.make_valid(shape) for shape in shapes]


def _closed(shape: Geometry) -> Geometry:
    grown = shapely.buffer(shape, _GAP_M / 2, join_style="mitre", mitre_limit=2.0)
    return shapely.buffer(grown, -_GAP_M / 2, join_style="mitre", mitre_limit=2.0)


def _opened(shape: Geometry) -> Geometry:
    """Removes slivers narrower than 0.3 m without moving the outline that remains."""
    core = shapely.buffer(shape, -_SPIKE_M, join_style="mitre", mitre_limit=2.0)
    regrown = shapely.buffer(core, _SPIKE_M * 1.5, join_style="mitre", mitre_limit=2.0)
    return shapely.intersection(shape, regrown, grid_size=_PRECISION_M)


def _clean(shape: Geometry) -> Geometry:
    """Fewer vertices, no pin holes, coordinates on a 1 cm grid."""
    parts = []
    for part in shapely.get_parts(_polygons_only(shapely.simplify(shape, 0.03))):
        holes = [ring for ring in part.interiors if shapely.Polygon(ring).area > _SMALL_HOLE_M2]
        parts.append(shapely.Polygon(part.exterior, holes))
    return _polygons_only(shapely.union_all(parts, grid_size=_PRECISION_M))


def _polygons_only(shape: Geometry) -> Geometry:
    """The polygons of a geometry, without the points and lines that overlays leave behind."""
    parts = shapely.get_parts(shapely.get_parts(shape))
    return shapely.MultiPolygon([p for p in parts if shapely.get_dimensions(p) == 2 and shapely.area(p) > 0.05])

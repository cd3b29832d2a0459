"""Paint on the road: lane and centre lines, stop lines, crossings, bay marks; and what lies in it."""

from __future__ import annotations

from zlib import crc32

import numpy as np
import shapely
from shapely import Geometry

from assets.mesh import Mesh
from assets.streets import ParkingBay, StopLine, StreetLane, Streets
from assets.world import polylines
from assets.world.ground.overlays import Heights, discs, ribbons

PAINT_RISE_M = 0.004
_PATCH_RISE_M, _LID_RISE_M = 0.002, 0.003
_LINE_M = 0.12
_SOLID_BEFORE_STOP_M = 14.0
_BAY_M = 6.0
_STOP_LINE_M, _YIELD_TOOTH_M = 0.40, 0.5
_CENTRE_LINE_MPS = 9.0  # no centre line below this limit (Germany, zones of 30 km/h: StVO § 45 (1c))
_SIGNAL_M = 15.0  # from a crossing with signals to a stop line
_ONE_ZEBRA_OF = 4  # crossings without signals; the others are not painted

Pieces = tuple[np.ndarray, np.ndarray, np.ndarray]  # starts, ends, widths


def markings_mesh(streets: Streets, carriageway: Geometry, height: Heights) -> Mesh:
    """All paint, 4 mm above the carriageway."""
    pieces = [
        *_lane_lines(streets, carriageway),
        *(_stop_line(stop, _lane_width(streets, stop)) for stop in streets.stop_lines),
        *_crossings(streets),
        *(_bay_marks(bay) for bay in streets.parking),
    ]
    if not pieces:
        return Mesh.empty()
    start, end, width = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return ribbons(start, end, width, lambda xy: height(xy) + PAINT_RISE_M, "road_marking")


def repairs_mesh(streets: Streets, carriageway: Geometry, height: Heights, rng: np.random.Generator) -> Mesh:
    """Asphalt patches and manhole lids scattered over the drive lanes."""
    lanes = [lane for lane in streets.lanes if lane.use == "drive" and not lane.internal]
    if not lanes:
        return Mesh.empty()
    length = np.array([polylines.stations(lane.centre)[-1] for lane in lanes])
    start, end, width, lids = [], [], [], []
    for lane, total in zip(lanes, length, strict=True):
        for station in rng.uniform(0, total, rng.poisson(total / 45.0)):
            run = rng.uniform(1.2, 7.0)
            line = polylines.offset(lane.centre, rng.uniform(-0.6, 0.6))
            ends = polylines.at(line, np.array([station, min(station + run, total)]))
            start.append(ends[0])
            end.append(ends[1])
            width.append(rng.uniform(0.5, 1.7))
        for station in rng.uniform(0, total, rng.poisson(total / 55.0)):
            lids.append(polylines.at(polylines.offset(lane.centre, rng.uniform(-0.9, 0.9)), np.array([station]))[0])
    patches = ribbons(
        np.reshape(start, (-1, 2)), np.reshape(end, (-1, 2)), np.array(width),
        lambda xy: height(xy) + _PATCH_RISE_M, "asphalt_patch",
    )  # fmt: skip
    lid = np.reshape(lids, (-1, 2))
    shapely.prepare(carriageway)
    lid = lid[shapely.contains_xy(carriageway, lid[:, 0], lid[:, 1])]
    return Mesh.merge([patches, discs(lid, 0.32, lambda xy: height(xy) + _LID_RISE_M, "manhole")])


def _lane_lines(streets: Streets, carriageway: Geometry) -> list[Pieces]:
    """Dashed lines between lanes of one direction, centre lines between directions."""
    edges: dict[str, list[StreetLane]] = {}
    for lane in streets.lanes:
        if lane.use in ("drive", "cycle") and not lane.internal:
            edges.setdefault(lane.edge, []).append(lane)
    shapely.prepare(carriageway)
    rim = shapely.boundary(carriageway)
    shapely.prepare(rim)
    pieces: list[Pieces] = []
    inward = -1.0 if streets.left_hand else 1.0  # from a lane towards the middle of the street
    centres: list[Geometry] = []
    for lanes in edges.values():
        lanes = sorted(lanes, key=lambda lane: int(lane.id.rsplit("_", 1)[-1]))
        for lane in lanes[:-1]:
            pieces.append(
                _widths(*polylines.dashes(polylines.offset(lane.centre, inward * lane.width_m / 2), 3.0, 4.5))
            )
        line = polylines.offset(lanes[-1].centre, inward * lanes[-1].width_m / 2)
        middle = shapely.Point(polylines.at(line, polylines.stations(line)[-1:] / 2)[0])
        if len(lanes) == 1 and lanes[0].speed_mps < _CENTRE_LINE_MPS:
            continue
        inside = shapely.contains(carriageway, middle) and shapely.distance(rim, middle) > 0.8
        if inside and (not centres or shapely.distance(np.array(centres), middle).min() > 0.8):
            centres.append(shapely.LineString(line))
            pieces += _centre_line(line) if len(lanes) == 1 else _double_line(line)
    return pieces


def _double_line(line: np.ndarray) -> list[Pieces]:
    """Double solid line in the middle of a street with several lanes per direction."""
    return [_widths(*polylines.solid(polylines.offset(line, side))) for side in (-_LINE_M, _LINE_M)]


def _centre_line(line: np.ndarray) -> list[Pieces]:
    """Dashed in the open, solid before either junction."""
    total = float(polylines.stations(line)[-1])
    if total < 3 * _SOLID_BEFORE_STOP_M:
        return [_widths(*polylines.solid(line))]
    inner = np.linspace(_SOLID_BEFORE_STOP_M, total - _SOLID_BEFORE_STOP_M, max(2, int(total / 8)))
    ends = [np.linspace(0, _SOLID_BEFORE_STOP_M, 4), np.linspace(total - _SOLID_BEFORE_STOP_M, total, 4)]
    runs = [_widths(*polylines.solid(polylines.at(line, station))) for station in ends]
    return [*runs, _widths(*polylines.dashes(polylines.at(line, inner), 3.0, 3.0))]


def _stop_line(stop: StopLine, lane_width_m: float) -> Pieces:
    """A bar across the lane, or teeth where one only yields."""
    ahead = np.array([np.cos(stop.heading_rad), np.sin(stop.heading_rad)])
    left = np.array([-ahead[1], ahead[0]])
    middle = stop.position[:2] - ahead * (_STOP_LINE_M / 2 + 0.6)
    half = lane_width_m / 2 - 0.1
    if stop.control != "yield":
        return _widths((middle - left * half)[None], (middle + left * half)[None], _STOP_LINE_M)
    begin = np.arange(-half, half - 0.3, 2 * _YIELD_TOOTH_M)[:, None]
    return _widths(middle + left * begin, middle + left * (begin + _YIELD_TOOTH_M), 0.3)


def _crossings(streets: Streets) -> list[Pieces]:
    """Broken lines along crossings with signals; zebra crossings at some of the others."""
    signals = np.array([stop.position[:2] for stop in streets.stop_lines if stop.control == "signal"]).reshape(-1, 2)
    pieces: list[Pieces] = []
    for lane in streets.lanes:
        if lane.use != "crossing":
            continue
        middle = polylines.at(lane.centre, polylines.stations(lane.centre)[-1:] / 2)
        if np.linalg.norm(signals - middle[:, :2], axis=1).min(initial=np.inf) < _SIGNAL_M:
            sides = (polylines.offset(lane.centre, side * lane.width_m / 2) for side in (-1.0, 1.0))
            pieces += [_widths(*polylines.dashes(side, 0.5, 0.5)) for side in sides]
        elif crc32(lane.id.encode()) % _ONE_ZEBRA_OF == 0:
            pieces.append(_zebra(lane))
    return pieces


def _zebra(crossing: StreetLane) -> Pieces:
    """Stripes along the traffic, half a metre wide, over the crossing's width."""
    station = np.arange(0.5, polylines.stations(crossing.centre)[-1] - 0.3, 1.0)
    middle, ahead = polylines.at(crossing.centre, station), polylines.headings(crossing.centre, station)
    half = ahead[:, ::-1] * [-1.0, 1.0] * (crossing.width_m / 2 - 0.1)
    return _widths(middle - half, middle + half, 0.5)


def _bay_marks(bay: ParkingBay) -> Pieces:
    """Lines across a parking strip between its bays, or along both sides of a single space."""
    centre, width_m = bay.centre, bay.width_m
    if bay.is_space:
        sides = np.stack([polylines.offset(centre, side * width_m / 2) for side in (-1.0, 1.0)])
        return _widths(sides[:, 0, :2], sides[:, -1, :2], 0.1)
    station = np.arange(0.06, polylines.stations(centre)[-1], _BAY_M)
    middle, ahead = polylines.at(centre, station), polylines.headings(centre, station)
    half = ahead[:, ::-1] * [-1.0, 1.0] * (width_m / 2 - 0.05)
    return _widths(middle - half, middle + half, 0.1)


def _widths(start: np.ndarray, end: np.ndarray, width_m: float = _LINE_M) -> Pieces:
    return start, end, np.full(len(start), width_m)


def _lane_width(streets: Streets, stop: StopLine) -> float:
    return next((lane.width_m for lane in streets.lanes if lane.id == stop.lane), 3.2)

"""Streets above other streets: the parts of lanes that are bridges, and their decks, railings and piers.

The land follows the lowest level. Where a lane passes over another one, it leaves the land 25 m before: from there to
25 m beyond, a deck carries it. Decks overlap the land by further 12 m, where the land falls away from them little by
little.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import shapely
from scipy.spatial import Delaunay, KDTree
from shapely import Geometry

from assets.mesh import Mesh
from assets.streets import StreetArea, StreetLane, Streets
from assets.world.polylines import stations

_SAMPLE_M = 1.0
_CLEARANCE_M = 2.5
_CORE_M, _OVERLAP_M = 25.0, 12.0
_SUNK_M = 0.4
_JOINED_M = 0.6  # ends of lanes that follow each other
_LEVEL_M = 1.2  # heights of one level
_GAP_M = 0.6
_EDGE_M = 2.0
_SLAB_M = 0.9
_ACROSS = 0.7  # cosine of the angle between a lane and an edge at its end
_RAILING_M, _RAILING_WIDTH_M = 0.9, 0.2
_PIERS_EVERY_M, _PIER_M, _PIERS_APART_M = 18.0, 1.0, 7.0

Heights = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Deck:
    """A bridge or a part of one, at one level.

    Attributes:
        outline: in the plane.
        samples: (n, 3) points along its lanes, from which it has its height.
        ends: (e, 4) middles of the ends of its lanes, and the directions of the lanes there (unit vectors).
        streets: its lanes only.
    """

    outline: Geometry
    samples: np.ndarray
    ends: np.ndarray
    streets: Streets

    def height(self, xy: np.ndarray) -> np.ndarray:
        """Height (n,) of the deck at points (n, 2)."""
        away, near = KDTree(self.samples[:, :2]).query(np.asarray(xy)[:, :2], k=min(3, len(self.samples)))
        away, near = away.reshape(len(xy), -1), near.reshape(len(xy), -1)
        weight = 1 / np.maximum(away, 0.05) ** 2
        return (weight * self.samples[near, 2]).sum(1) / weight.sum(1)


@dataclass(frozen=True, eq=False)
class _Samples:
    """Points along all lanes.

    Attributes:
        point: (n, 3).
        lane: (n,) number of the lane.
        station: (n,) distance from its start [m].
        half_m: (n,) half its width.
    """

    point: np.ndarray
    lane: np.ndarray
    station: np.ndarray
    half_m: np.ndarray

    @classmethod
    def of(cls, lanes: tuple[StreetLane, ...]) -> _Samples:
        points, lane, station = [], [], []
        for number, each in enumerate(lanes):
            along = stations(each.centre)
            at = np.linspace(0, along[-1], max(2, int(np.ceil(along[-1] / _SAMPLE_M)) + 1))
            points.append(np.column_stack([np.interp(at, along, each.centre[:, axis]) for axis in range(3)]))
            lane.append(np.full(len(at), number))
            station.append(at)
        number = np.concatenate(lane)
        half = np.array([each.width_m / 2 for each in lanes])[number]
        return cls(np.concatenate(points), number, np.concatenate(station), half)


def split_levels(streets: Streets) -> tuple[Streets, tuple[Deck, ...]]:
    """The streets that lie on the land, and the decks above them; the same streets where none lies above another."""
    samples = _Samples.of(streets.lanes)
    over = _passing_over(samples)
    if not over.any():
        return streets, ()
    reach = _reach(streets.lanes, samples, over)
    core, deck = reach < _CORE_M, reach < _CORE_M + _OVERLAP_M
    tree = KDTree(samples.point[core, :2])
    areas, raised = [], []
    for area in streets.areas:
        on_deck = _is_near(area.outline.mean(0), samples.point[core], tree)
        (raised if on_deck else areas).append(area)
    land = tuple(piece for number, lane in enumerate(streets.lanes) for piece in _on_land(lane, number, samples, reach))
    ground = replace(
        streets,
        lanes=land,
        areas=tuple(areas),
        parking=tuple(bay for bay in streets.parking if not _is_near(bay.centre.mean(0), samples.point[core], tree)),
        stop_lines=tuple(stop for stop in streets.stop_lines if not _is_near(stop.position, samples.point[core], tree)),
    )
    return ground, _decks(streets, samples, deck, raised)


def decks_mesh(decks: tuple[Deck, ...], ground: Heights, below: Geometry) -> tuple[Mesh, Mesh]:
    """Road surfaces with the slabs below them; railings and piers.

    Args:
        decks: of the streets.
        ground: height of the land.
        below: carriageway on the land, which piers leave free.
    """
    surfaces, rest = [], []
    for deck in decks:
        top, rim = _surface(deck)
        surfaces += [top, _slab(top, rim)]
        rest += [_railings(deck, top, rim), _piers(deck, ground, below)]
    return Mesh.merge(surfaces), Mesh.merge(rest)


def _passing_over(samples: _Samples) -> np.ndarray:
    """(n,) bool samples that lie above another lane."""
    from scipy.ndimage import minimum_filter

    z = samples.point[:, 2]
    over = np.zeros(len(z), bool)
    if np.ptp(z) < _CLEARANCE_M:
        return over
    cell = np.floor((samples.point[:, :2] - samples.point[:, :2].min(0)) / 4.0).astype(int) + 1
    lowest = np.full(tuple(cell.max(0) + 2), np.inf)
    np.minimum.at(lowest, (cell[:, 0], cell[:, 1]), z)
    possible = np.flatnonzero(z - minimum_filter(lowest, 3)[cell[:, 0], cell[:, 1]] > _CLEARANCE_M)
    if not len(possible):
        return over
    tree = KDTree(samples.point[:, :2])
    near = tree.query_ball_point(samples.point[possible, :2], samples.half_m[possible] + 0.5)
    for row, others in zip(possible.tolist(), near, strict=True):
        over[row] = bool((z[row] - z[others] > _CLEARANCE_M).any())
    return over


def _reach(lanes: tuple[StreetLane, ...], samples: _Samples, over: np.ndarray) -> np.ndarray:
    """Distance (n,) along the lanes from each sample to the nearest one that passes over another lane."""
    reach = np.full(len(samples.point), np.inf)
    first = np.searchsorted(samples.lane, np.arange(len(lanes) + 1))
    ends = np.stack([samples.point[first[:-1]], samples.point[first[1:] - 1]], axis=1).reshape(-1, 3)
    joined = KDTree(ends).query_ball_point(ends, _JOINED_M)
    most = _CORE_M + _OVERLAP_M
    queue: list[tuple[int, float, float]] = []  # lane, station, distance there
    for number in np.unique(samples.lane[over]).tolist():
        rows = slice(first[number], first[number + 1])
        at = samples.station[rows][over[rows]]
        reach[rows] = np.minimum(reach[rows], np.abs(samples.station[rows][:, None] - at[None]).min(1))
        for end in (0, 1):
            distance = float(reach[rows][0 if end == 0 else -1])
            queue += [(other, distance, 0.0) for other in joined[2 * number + end] if distance < most]
    while queue:
        end, distance, _ = queue.pop()
        number, side = divmod(end, 2)
        rows = slice(first[number], first[number + 1])
        station = samples.station[rows]
        along = distance + (station if side == 0 else station[-1] - station)
        if along[0 if side == 0 else -1] >= reach[rows][0 if side == 0 else -1]:
            continue
        reach[rows] = np.minimum(reach[rows], along)
        far = float(reach[rows][-1 if side == 0 else 0])
        if far < most:
            queue += [(other, far, 0.0) for other in joined[2 * number + (1 - side)]]
    return reach


def _on_land(lane: StreetLane, number: int, samples: _Samples, reach: np.ndarray) -> list[StreetLane]:
    """The parts of a lane that lie on the land, lowered where a deck covers them."""
    rows = np.flatnonzero(samples.lane == number)
    near = reach[rows]
    if (near >= _CORE_M + _OVERLAP_M).all():
        return [lane]
    pieces, parts = [], np.split(rows, np.flatnonzero(np.diff((near < _CORE_M).astype(int))) + 1)
    for part in parts:
        if reach[part[0]] < _CORE_M or len(part) < 2:
            continue
        centre = samples.point[part].copy()
        share = np.clip(1 - (reach[part] - _CORE_M) / _OVERLAP_M, 0, 1)
        centre[:, 2] -= _SUNK_M * share
        edge = f"{lane.edge}#{len(pieces)}"
        index = lane.id.rpartition("_")[2]
        pieces.append(replace(lane, id=f"{edge}_{index}", edge=edge, centre=centre))
    return pieces


def _is_near(position: np.ndarray, points: np.ndarray, tree: KDTree) -> bool:
    near = tree.query_ball_point(position[:2], 6.0)
    return bool(len(near)) and bool((np.abs(points[near, 2] - position[2]) < _LEVEL_M).any())


def _decks(streets: Streets, samples: _Samples, deck: np.ndarray, raised: list[StreetArea]) -> tuple[Deck, ...]:
    """Decks of lanes that touch each other at one height."""
    pieces: list[tuple[StreetLane, np.ndarray]] = []
    for number, lane in enumerate(streets.lanes):
        rows = np.flatnonzero(samples.lane == number)
        for part in np.split(rows, np.flatnonzero(np.diff(deck[rows].astype(int))) + 1):
            if deck[part[0]] and len(part) > 1:
                pieces.append((replace(lane, centre=samples.point[part]), samples.point[part]))
    strips = [_strip(lane) for lane, _ in pieces]
    group = np.arange(len(pieces))
    tree = shapely.STRtree(strips)
    for a, b in tree.query(strips, predicate="dwithin", distance=_GAP_M).T.tolist():
        if a < b and _meet(pieces[a][1], pieces[b][1]):
            group[group == group[b]] = group[a]
    decks = []
    for name in np.unique(group).tolist():
        rows = np.flatnonzero(group == name).tolist()
        points = np.concatenate([pieces[row][1] for row in rows])
        near = KDTree(points[:, :2])
        areas = [
            shapely.make_valid(shapely.Polygon(a.outline[:, :2]))
            for a in raised
            if _is_near(a.outline.mean(0), points, near)
        ]
        whole = shapely.buffer(
            shapely.union_all([*(strips[row] for row in rows), *areas]), _GAP_M / 2, join_style="mitre"
        )
        whole = shapely.simplify(shapely.buffer(whole, -_GAP_M / 2, join_style="mitre"), 0.03)
        ends = np.concatenate([_ends(pieces[row][1]) for row in rows])
        own = replace(
            streets,
            lanes=tuple(pieces[row][0] for row in rows),
            areas=(),
            parking=(),
            stop_lines=(),
            buildings=(),
            trees=(),
        )
        decks.append(Deck(whole, points, ends, own))
    return tuple(decks)


def _ends(line: np.ndarray) -> np.ndarray:
    """Positions and directions (2, 4) of a line at its two ends."""
    way = np.stack([line[1] - line[0], line[-1] - line[-2]])[:, :2]
    length = np.linalg.norm(way, axis=1, keepdims=True)
    return np.column_stack([line[[0, -1], :2], way / np.maximum(length, 1e-9)])


def _strip(lane: StreetLane) -> Geometry:
    line = shapely.LineString(lane.centre[:, :2])
    return shapely.buffer(line, lane.width_m / 2, cap_style="flat", join_style="mitre", mitre_limit=2.0)


def _meet(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two lines have one height where they are nearest."""
    away, near = KDTree(second[:, :2]).query(first[:, :2])
    row = int(away.argmin())
    return bool(abs(first[row, 2] - second[np.asarray(near)[row], 2]) < _LEVEL_M)


def _surface(deck: Deck) -> tuple[Mesh, np.ndarray]:
    """The top of a deck, and the directed edges (e, 2) of its rim, rows of its vertices."""
    rim = shapely.get_coordinates(shapely.segmentize(shapely.boundary(deck.outline), _EDGE_M))
    low, high = rim.min(0), rim.max(0)
    grid = np.stack(np.meshgrid(*(np.arange(a, b, _EDGE_M) for a, b in zip(low, high, strict=True))), -1).reshape(-1, 2)
    shapely.prepare(deck.outline)
    inner = grid[shapely.contains_xy(deck.outline, grid[:, 0], grid[:, 1])]
    inner = inner[KDTree(rim).query(inner)[0] > 0.5 * _EDGE_M] if len(inner) else inner
    points = np.unique(np.round(np.concatenate([rim, inner]), 4), axis=0)
    faces = Delaunay(points).simplices
    corner = points[faces]
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    faces = np.where((area < 0)[:, None], faces[:, ::-1], faces)
    middle = corner.mean(1)
    inside = shapely.contains_xy(deck.outline, middle[:, 0], middle[:, 1]) & (np.abs(area) > 1e-4)
    faces = faces[inside]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    code, back = edges[:, 0] * len(points) + edges[:, 1], edges[:, 1] * len(points) + edges[:, 0]
    vertices = np.column_stack([points, deck.height(points)])
    return Mesh.of(vertices, faces, "asphalt"), edges[~np.isin(code, back)]


def _slab(top: Mesh, rim: np.ndarray) -> Mesh:
    """Underside and sides of a deck."""
    count, low = len(top.vertices), top.vertices - [0, 0, _SLAB_M]
    a, b = rim.T
    sides = np.concatenate([np.column_stack([a, a + count, b + count]), np.column_stack([a, b + count, b])])
    faces = np.concatenate([top.faces[:, ::-1] + count, sides])
    return Mesh.of(np.concatenate([top.vertices, low]), faces, "concrete")


def _railings(deck: Deck, top: Mesh, rim: np.ndarray) -> Mesh:
    """Walls along the rim, but not across the ends of lanes."""
    start, end = (top.vertices[rim[:, side]].astype(float) for side in (0, 1))
    middle = (start + end)[:, :2] / 2
    way = (end - start)[:, :2]
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    widest = max(lane.width_m for lane in deck.streets.lanes)
    away, nearest = KDTree(deck.ends[:, :2]).query(middle)
    is_across = np.abs((way * deck.ends[nearest, 2:]).sum(1)) < _ACROSS
    open_ = is_across & (away < widest / 2 + _EDGE_M / 2)
    start, end, way = start[~open_], end[~open_], way[~open_]
    if not len(start):
        return Mesh.empty()
    inward = np.column_stack([-way[:, 1], way[:, 0]])
    step = np.column_stack([inward * _RAILING_WIDTH_M, np.zeros(len(start))])
    up = np.array([0, 0, _RAILING_M])
    corners = np.stack(
        [start, end, end + step, start + step, start + up, end + up, end + step + up, start + step + up], 1
    )
    quads = np.array([[0, 1, 5, 4], [2, 3, 7, 6], [4, 5, 6, 7]])
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    faces = (faces[None] + 8 * np.arange(len(start))[:, None, None]).reshape(-1, 3)
    return Mesh.of(corners.reshape(-1, 3), faces, "concrete")


def _piers(deck: Deck, ground: Heights, below: Geometry) -> Mesh:
    """Columns between the land and the slab, next to the carriageway below."""
    from assets.shapes import box

    places: list[np.ndarray] = []
    free = shapely.buffer(below, _PIER_M)
    shapely.prepare(free)
    step = max(1, round(_PIERS_EVERY_M / _SAMPLE_M))
    for point in deck.samples[step // 2 :: step]:
        high = point[2] - _SLAB_M - float(ground(point[None, :2])[0])
        blocked = bool(shapely.contains_xy(free, point[0], point[1]))
        if (
            high < 1.0
            or blocked
            or any(np.linalg.norm(position[:2] - point[:2]) < _PIERS_APART_M for position in places)
        ):
            continue
        places.append(point)
    columns = []
    for x, y, z in places:
        foot = float(ground(np.array([[x, y]]))[0]) - 0.3
        top = z - _SLAB_M
        columns.append(box((_PIER_M, _PIER_M, top - foot), (x, y, (top + foot) / 2), "concrete"))
    return Mesh.merge(columns)

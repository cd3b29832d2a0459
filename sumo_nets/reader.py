"""Street geometry from SUMO's files; netconvert's outlines that cross themselves are repaired."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely

from assets.streets import LaneUse, ParkingBay, StopLine, StreetArea, StreetLane, Streets
from sumo_nets import polyline
from sumo_nets.errors import TownError
from sumo_nets.lanes import RAILWAYS, has_tracks, points, use_of
from sumo_nets.scenery import read_scenery
from sumo_nets.xml_guard import read_xml

_DEFAULT_PARKING_WIDTH_M = 3.2
_OFF_THE_ROAD = {"rail": RAILWAYS, "water": frozenset({"ship"}), "air": frozenset({"aircraft", "drone"})}
_SAME_POINT_M = 0.03
_SPECK_M2 = 0.05


def read_network(net: Path) -> Any:
    """Return a network as sumolib reads it, without what lies inside junctions."""
    import sumolib

    return sumolib.net.readNet(str(net))


def read_streets(name: str, net_path: Path, additional_paths: tuple[Path, ...], style: str) -> Streets:
    """Read a network and the parking areas that go with it.

    Lanes closed to everyone (the strips that `build_town` carves for parking) are given as `junction` areas: paved
    carriageway that nothing drives on. Their parking lots lie within them.

    Raises:
        TownError: a file is not safe, whole XML, or a shape lies nowhere.
    """
    import sumolib

    left_hand = read_xml(net_path, "net").get("lefthand") in ("true", "1")
    try:
        net = sumolib.net.readNet(str(net_path), withInternal=True, withPedestrianConnections=True, lxml=False)
    except (LookupError, ValueError, TypeError, AttributeError) as error:
        raise TownError(f"{net_path}: is not a complete network ({type(error).__name__}: {error})") from error
    try:
        lanes, areas, stops = _geometry(net)
    except ValueError as error:
        raise TownError(f"{net_path}: {error}; make the network again") from error
    parking = [bay for path in additional_paths for bay in _parking(path, net, left_hand)]
    buildings, trees = read_scenery(additional_paths)
    return Streets(name, tuple(lanes), tuple(areas), tuple(parking), tuple(stops), style, left_hand, buildings, trees)


def not_drawn(net_path: Path) -> tuple[str, ...]:
    """A note with the number of edges without road users and trams (railways etc.), if there are any."""
    types: Counter[str] = Counter()
    for edge in read_xml(net_path, "net").iter("edge"):
        if edge.get("function"):
            continue
        allowed = {name for lane in edge.iter("lane") for name in lane.get("allow", "all").split()}
        for kind, classes in _OFF_THE_ROAD.items():
            if allowed <= classes:
                types[kind] += 1
                break
    what = " and ".join(f"{number} edges of {kind}" for kind, number in sorted(types.items()))
    return (f"{net_path}: not drawn: {what}",) * bool(what)


def _geometry(net: Any) -> tuple[list[StreetLane], list[StreetArea], list[StopLine]]:
    """Return lanes, areas and stop lines."""
    lanes, areas, stops = [], [], []
    reversals = {link.getViaLaneID() for link in _links(net) if link.getDirection() == "t"}
    for edge in net.getEdges(withInternal=True):
        if edge.getFunction() == "walkingarea":
            areas += _areas(edge.getID(), "walkingarea", points(edge.getLanes()[0].getShape3D()))
            continue
        for lane in edge.getLanes():
            centre = points(lane.getShape3D())
            use = use_of(edge, lane)
            if use is not None:
                tracks = has_tracks(lane) and lane.getID() not in reversals
                lanes.append(_lane(edge, lane, use, centre, tracks))
            elif not lane.getPermissions():
                areas += _areas(lane.getID(), "junction", polyline.strip(centre, lane.getWidth()))
        stops += _stop_lines(edge)
    for node in net.getNodes():
        areas += _areas(node.getID(), "junction", points(node.getShape3D()))
    return lanes, areas, stops


def _areas(name: str, use: Literal["junction", "walkingarea"], corners: np.ndarray) -> list[StreetArea]:
    """Return an area, in pieces `NAME`, `NAME#1`, … where its outline crosses itself."""
    outlines = simple_outlines(corners)
    return [StreetArea(f"{name}#{i}" if i else name, use, outline) for i, outline in enumerate(outlines)]


def _links(net: Any) -> list[Any]:
    return [link for edge in net.getEdges() for links in edge.getOutgoing().values() for link in links]


def _lane(edge: Any, lane: Any, use: LaneUse, centre: np.ndarray, tracks: bool) -> StreetLane:
    internal = edge.getFunction() in ("internal", "crossing")
    size = float(lane.getWidth()), float(lane.getSpeed())
    return StreetLane(lane.getID(), edge.getID(), use, centre, *size, internal, tracks)


def _parking(path: Path, net: Any, left_hand: bool) -> list[ParkingBay]:
    """Return the strips of an additional file's parking areas.

    A strip's centre line is next to its lane, at half the lane's width plus half its own. Measured with SUMO 1.28 on
    200 vehicles: a parked vehicle's front bumper is at the far end of its lot, within 0.35 m along the strip, 5 cm
    across, 1 cm in height and 0.4° in angle. (Its slope is that of another place: take the strip's.)

    Heights are the lane's. Areas on the carriageway (`onRoad`) have no strip; vehicles in an angled area reach beyond
    the strip, which is given as if they were parallel to the lane; lots given one by one (`<space>`) are a strip each.
    """
    bays = []
    for area in read_xml(path).iter("parkingArea"):
        if area.get("onRoad") in ("true", "1"):
            continue
        try:
            spaces = area.findall("space")
            bays += [_space(area, space, i) for i, space in enumerate(spaces)] or [_roadside(area, net, left_hand)]
        except (LookupError, ValueError) as error:
            raise TownError(f"{path}: parkingArea {area.get('id')!r} cannot be placed ({error})") from error
    return bays


def _roadside(area: ET.Element, net: Any, left_hand: bool) -> ParkingBay:
    lane_id = area.get("lane", "")
    if not net.hasEdge(lane_id.rpartition("_")[0]):
        raise LookupError(f"lane {lane_id!r} does not exist")
    lane = net.getLane(lane_id)
    centre = points(lane.getShape3D())
    total = float(lane.getLength())
    start, end = (float(area.get(key, default)) for key, default in (("startPos", "0"), ("endPos", str(total))))
    start, end = (at + total if at < 0 else at for at in (start, end))
    width = float(area.get("width", _DEFAULT_PARKING_WIDTH_M))
    scale = polyline.length(centre) / total if total > 0 else 1.0
    aside = (float(lane.getWidth()) + width) / 2 * (-1.0 if left_hand else 1.0)
    return ParkingBay(area.get("id", ""), polyline.beside(centre, aside, start * scale, end * scale), width)


def _space(area: ET.Element, space: ET.Element, number: int) -> ParkingBay:
    """Return a single lot. Its x, y are the front end; its angle turns counter-clockwise from south (measured)."""
    front = np.array([float(space.get(axis, "0")) for axis in "xyz"])
    size = {
        key: float(space.get(key) or area.get(key) or default) for key, default in (("width", 3.2), ("length", 5.0))
    }
    angle = math.radians(float(space.get("angle") or area.get("angle") or 0) - 90)
    ahead = np.array([math.cos(angle), math.sin(angle), 0.0])
    centre = np.stack([front - size["length"] * ahead, front])
    return ParkingBay(f"{area.get('id', '')}:{number}", centre, size["width"], is_space=True)


def _stop_lines(edge: Any) -> list[StopLine]:
    """Return the stop lines of a sumolib edge's driving lanes.

    A street yields where each of its movements, except U-turns, gives way to another street's traffic; one of lower
    priority than another street there, where any does. So a main road has no line although its left turns wait for
    oncoming traffic, nor has a street that only yields to a crossing, nor one where the right goes before the left.
    """
    if edge.getFunction():
        return []
    lanes = [lane for lane in edge.getLanes() if use_of(edge, lane) == "drive"]
    links = {lane: [link for link in lane.getOutgoing() if link.getDirection() != "t"] for lane in lanes}
    held = _control(edge, [link for lane in lanes for link in links[lane]])
    lines = []
    for lane in lanes:
        control = "signal" if any(link.getTLSID() for link in links[lane]) else held
        if control and links[lane]:
            centre = points(lane.getShape3D())
            lines.append(StopLine(lane.getID(), centre[-1], polyline.heading(centre), control))
    return lines


def _control(edge: Any, links: list[Any]) -> Literal["stop", "yield"] | None:
    states = {link.getState() for link in links}
    if states & {"s", "w"}:
        return "stop"
    if "m" not in states or states & {"M", "="}:
        return None
    node = edge.getToNode()
    others = [link for link in node.getConnections() if _comes_from_another_street(link, edge)]
    gives_way = [any(node.forbids(other, link) for other in others) for link in links]
    minor = any(other.getFrom().getPriority() > edge.getPriority() for other in others)
    return "yield" if (any(gives_way) if minor else all(gives_way)) else None


def _comes_from_another_street(link: Any, edge: Any) -> bool:
    other = link.getFrom()
    drives = use_of(other, link.getFromLane()) == "drive" and not other.getFunction()
    return drives and other is not edge and link.getDirection() != "t"


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
    return [np.column_stack([xy, _heights_along(outline, xy)]) for xy in corners if len(xy) >= 3]


def _without_repeats(points: np.ndarray) -> np.ndarray:
    kept: list[np.ndarray] = []
    for point in points:
        if not kept or np.linalg.norm(point[:2] - kept[-1][:2]) > _SAME_POINT_M:
            kept.append(point)
    while len(kept) > 1 and np.linalg.norm(kept[-1][:2] - kept[0][:2]) <= _SAME_POINT_M:
        kept.pop()
    return np.array(kept)


def _heights_along(outline: np.ndarray, xy: np.ndarray) -> np.ndarray:
    closed = np.vstack([outline, outline[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed[:, :2], axis=0), axis=1))])
    ring = shapely.LineString(closed[:, :2])
    return np.interp([ring.project(shapely.Point(p)) for p in xy], along, closed[:, 2])

"""Roads of an OpenDRIVE file."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from cosim.traffic.opendrive.plan_view import Curve, PlanView, explicit_cubic, line, polynomial, spiral
from cosim.traffic.opendrive.road import Cubics, Lane, LaneSection, OpenDriveError, Road, RoadLink

_SIDES = {"left": 1, "right": -1}


def read_road(path: Path, element: ET.Element) -> Road:
    """A road from its element.

    Raises:
        OpenDriveError: a value is missing or no number, or the road has no reference line.
    """
    name = element.get("id", "")
    try:
        return _road(name, element)
    except (ValueError, TypeError, KeyError) as error:
        reason = f"attribute {error} is missing" if isinstance(error, KeyError) else str(error)
        raise OpenDriveError(f"{path}: road {name!r} cannot be read: {reason}; correct the file") from error


def _road(name: str, element: ET.Element) -> Road:
    links = element.find("link")
    lanes = element.find("lanes")
    junction = element.get("junction", "-1")
    return Road(
        id=name,
        length_m=_number(element, "length"),
        junction="" if junction == "-1" else junction,
        keeps_left=element.get("rule", "RHT").upper() == "LHT",
        plan_view=_plan_view(element),
        elevation=_cubics(element.findall("elevationProfile/elevation"), "s"),
        superelevation=_cubics(element.findall("lateralProfile/superelevation"), "s"),
        lane_offset=_cubics([] if lanes is None else lanes.findall("laneOffset"), "s"),
        sections=() if lanes is None else _sections(lanes),
        predecessor=_link(links, "predecessor"),
        successor=_link(links, "successor"),
    )


def _number(element: ET.Element, name: str, default: float | None = None) -> float:
    text = element.get(name)
    if text is None and default is None:
        raise KeyError(f"{element.tag}.{name}")
    value = float(default if text is None else text)  # type: ignore[arg-type]
    if not np.isfinite(value):
        raise ValueError(f"{element.tag}.{name} is {text}")
    return value


def _numbers(element: ET.Element, names: str) -> list[float]:
    return [_number(element, name, 0.0) for name in names.split()]


def _plan_view(element: ET.Element) -> PlanView:
    pieces = sorted(element.findall("planView/geometry"), key=lambda piece: _number(piece, "s"))
    if not pieces:
        raise ValueError("it has no geometry in its planView")
    start = [[_number(piece, "x"), _number(piece, "y"), _number(piece, "hdg")] for piece in pieces]
    return PlanView(
        np.array([_number(piece, "s") for piece in pieces]), np.array(start), tuple(_curve(piece) for piece in pieces)
    )


def _curve(piece: ET.Element) -> Curve:
    length = _number(piece, "length")
    for shape in piece:
        if shape.tag == "line":
            return line()
        if shape.tag == "arc":
            curvature = _number(shape, "curvature")
            return spiral(curvature, curvature, length)
        if shape.tag == "spiral":
            return spiral(_number(shape, "curvStart"), _number(shape, "curvEnd"), length)
        if shape.tag == "poly3":
            return explicit_cubic(_numbers(shape, "a b c d"), length)
        if shape.tag == "paramPoly3":
            u, v = _numbers(shape, "aU bU cU dU"), _numbers(shape, "aV bV cV dV")
            by_length = shape.get("pRange", "normalized") == "arcLength"
            return polynomial(u, v, length if by_length else 1.0, None if by_length else length)
    raise ValueError(f"its geometry at s = {piece.get('s')} m is no line, arc, spiral, poly3 or paramPoly3")


def _cubics(pieces: list[ET.Element], start: str) -> Cubics:
    rows = sorted([_number(piece, start), *_numbers(piece, "a b c d")] for piece in pieces)
    values = np.array(rows, float).reshape(-1, 5)
    return Cubics(values[:, 0], values[:, 1:])


def _sections(lanes: ET.Element) -> tuple[LaneSection, ...]:
    sections = sorted(lanes.findall("laneSection"), key=lambda section: _number(section, "s"))
    return tuple(_section(section) for section in sections)


def _section(section: ET.Element) -> LaneSection:
    is_single = section.get("singleSide", "false").lower() in ("true", "1")
    sides = tuple(side for tag, side in _SIDES.items() if section.find(tag) is not None)
    lanes = [_lane(lane) for tag in _SIDES for lane in section.findall(f"{tag}/lane")]
    return LaneSection(_number(section, "s"), sides if is_single else (1, -1), {lane.id: lane for lane in lanes})


def _lane(lane: ET.Element) -> Lane:
    widths, borders = lane.findall("width"), lane.findall("border")
    linked = [lane.find(f"link/{end}") for end in ("predecessor", "successor")]
    before, after = (None if each is None else int(_number(each, "id")) for each in linked)
    return Lane(
        id=int(_number(lane, "id")),
        type=lane.get("type", ""),
        width=_cubics(widths, "sOffset") if widths else None,
        border=_cubics(borders, "sOffset") if borders and not widths else None,
        is_reversed=lane.get("direction") == "reversed",
        predecessor=before,
        successor=after,
    )


def _link(links: ET.Element | None, end: str) -> RoadLink | None:
    found = None if links is None else links.find(end)
    if found is None or not found.get("elementId"):
        return None
    at_start = found.get("contactPoint", "start") == "start"
    return RoadLink(found.get("elementType", "road"), found.get("elementId", ""), at_start)

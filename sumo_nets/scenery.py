"""Buildings and trees from the polygons and points of a scenario's additional files, as `polyconvert` writes them."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import shapely

from assets.streets import StreetBuilding
from sumo_nets.errors import TownError
from sumo_nets.xml_guard import read_xml

_STOREY_M = 3.0
_TALLEST_M = 500.0
_WOODS = ("natural.wood", "landuse.forest", "forest", "wood")
_TREE_EVERY_M = 7.0
_MOST_TREES = 4000


def read_scenery(files: Iterable[Path]) -> tuple[tuple[StreetBuilding, ...], tuple[tuple[float, float], ...]]:
    """Read buildings (polygons whose type starts with `building`) and positions of trees.

    Trees are points whose type ends in `tree`, and a grid of points within woods.

    Raises:
        TownError: a file is no safe, whole XML, or a shape or height is not made of numbers.
    """
    buildings: list[StreetBuilding] = []
    trees: list[tuple[float, float]] = []
    for path in files:
        root = read_xml(path)
        for element in root.iter("poly"):
            kind = element.get("type", "").lower()
            if element.get("geo") in ("true", "1"):
                continue  # degrees, which cannot be converted to metres without the network
            if kind.startswith("building"):
                outline = _outline(path, element)
                if len(outline) >= 3:
                    buildings.append(StreetBuilding(element.get("id", ""), outline, _height(path, element)))
            elif kind in _WOODS:
                trees += _wood(_outline(path, element))
        for element in root.iter("poi"):
            if element.get("type", "").lower().rpartition(".")[2] == "tree" and "x" in element.attrib:
                trees.append((_number(path, element, "x"), _number(path, element, "y")))
    return tuple(buildings), tuple(trees[:_MOST_TREES])


def _outline(path: Path, element: ET.Element) -> np.ndarray:
    """Corners (k, 2), not closed."""
    try:
        corners = [[float(v) for v in point.split(",")[:2]] for point in element.get("shape", "").split()]
        outline = np.array(corners, float).reshape(-1, 2)
    except ValueError:
        outline = np.full((1, 2), math.nan)
    if not np.isfinite(outline).all():
        raise TownError(f"{path}: poly {element.get('id')!r} has a shape that is not x,y x,y …; write it so")
    return outline[:-1] if len(outline) > 1 and np.array_equal(outline[0], outline[-1]) else outline


def _height(path: Path, element: ET.Element) -> float | None:
    """Height of its walls from the parameter `height` [m] or `building:levels`, if given."""
    given = {param.get("key", ""): param.get("value", "") for param in element.iter("param")}
    for key, unit_m in (("height", 1.0), ("building:levels", _STOREY_M)):
        text = given.get(key, "").removesuffix("m").strip()
        if not text:
            continue
        try:
            height = float(text) * unit_m
        except ValueError:
            continue  # OpenStreetMap holds whatever people write
        if not 0 < height <= _TALLEST_M:
            raise TownError(f"{path}: poly {element.get('id')!r} has {key} {text}; give 0 to {_TALLEST_M:g} m")
        return height
    return None


def _wood(outline: np.ndarray) -> list[tuple[float, float]]:
    """A grid of places within a wood, every other row shifted."""
    if len(outline) < 3:
        return []
    wood = shapely.make_valid(shapely.Polygon(outline))
    low, high = outline.min(0), outline.max(0)
    rows = np.arange(low[1], high[1], _TREE_EVERY_M)
    spots = [
        (float(x), float(y))
        for number, y in enumerate(rows)
        for x in np.arange(low[0] + (number % 2) * _TREE_EVERY_M / 2, high[0], _TREE_EVERY_M)
    ]
    inside = shapely.contains_xy(wood, *np.array(spots).T) if spots else []
    return [spot for spot, within in zip(spots, inside, strict=True) if within]


def _number(path: Path, element: ET.Element, key: str) -> float:
    try:
        value = float(element.get(key, ""))
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise TownError(f"{path}: poi {element.get('id')!r} has {key} {element.get(key)!r}; write a number")
    return value

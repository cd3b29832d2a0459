"""A local origin for networks far from zero, as those in UTM or Web Mercator coordinates.

Meshes and rays hold float32 numbers, whose steps are 0.5 m at 5 000 km. A network whose middle lies more than 10 km
from zero is therefore moved by whole kilometres: SUMO, the world and all poses use coordinates near zero, and the
offset is kept in double precision. Numbers in files are moved as decimals, so that nothing is rounded.
"""

from __future__ import annotations

import copy
import hashlib
import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import replace
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from platformdirs import user_cache_path

from assets.cache import FOLDER
from assets.streets import Streets
from sumo_nets.errors import TownError
from sumo_nets.scenario import Scenario
from sumo_nets.xml_guard import read_xml

_FAR_M = 10_000.0
_STEP_M = 1000.0
_POINTS = frozenset({"junction", "poi", "space", "parkingArea"})

Origin = tuple[float, float, float]
ZERO: Origin = (0.0, 0.0, 0.0)


def find_origin(positions: np.ndarray) -> Origin:
    """Offset (x, y, z) [m] of the local origin of places (n, 2): zero where they lie near zero."""
    positions = positions[np.isfinite(positions).all(1)]
    if not len(positions):
        return ZERO
    middle = np.median(positions, axis=0)
    if (np.abs(middle) <= _FAR_M).all():
        return ZERO
    x, y = (np.round(middle / _STEP_M) * _STEP_M).tolist()
    return x, y, 0.0


def net_origin(net: Path) -> Origin:
    """Offset of a network, by its junctions.

    Raises:
        TownError: a junction has no coordinates.
    """
    places = []
    for junction in read_xml(net, "net").iter("junction"):
        if junction.get("type") != "internal":
            try:
                places.append((float(junction.get("x", "")), float(junction.get("y", ""))))
            except ValueError:
                raise TownError(
                    f"{net}: junction {junction.get('id')!r} has x {junction.get('x')!r}, y {junction.get('y')!r}; "
                    "make the network again with netconvert"
                ) from None
    return find_origin(np.array(places, float).reshape(-1, 2))


def move_file(path: Path, root: ET.Element, origin: Origin) -> Path:
    """A copy of a network or an additional file in local coordinates; the file itself where it has no coordinates.

    Copies lie in the user's cache folder under the hash of their content.

    Raises:
        TownError: a coordinate is no number, or the copy cannot be written.
    """
    moved = copy.deepcopy(root)
    try:
        changed = _move(moved, Decimal(str(origin[0])), Decimal(str(origin[1])))
    except InvalidOperation as error:
        raise TownError(f"{path}: a coordinate is no number; make the file again") from error
    if not changed:
        return path
    data = ET.tostring(moved)
    where = os.environ.get(FOLDER)
    base = Path(where) if where else Path(tempfile.gettempdir()) / "cosim" if where == "" else user_cache_path("cosim")
    folder = base / "moved" / hashlib.sha256(data).hexdigest()[:24]
    target = folder / path.name.removesuffix(".gz")
    if not target.is_file():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            partial = target.with_name(f"{target.name}.{os.getpid()}.partial")
            partial.write_bytes(data)
            partial.replace(target)
        except OSError as error:
            raise TownError(
                f"{target}: cannot be written ({error.strerror}); set {FOLDER} to a folder that can"
            ) from error
    return target


def move_scenario(scenario: Scenario, origin: Origin) -> Scenario:
    """A scenario whose network and additional files are in local coordinates."""
    files: Mapping[str, tuple[Path, ...]] = {
        option: tuple(move_file(path, _root(scenario, path), origin) for path in paths)
        if option in ("net-file", "additional-files")
        else paths
        for option, paths in scenario.files.items()
    }
    return replace(scenario, files=files)


def _root(scenario: Scenario, path: Path) -> ET.Element:
    return ET.fromstring(scenario.changed[path]) if path in scenario.changed else read_xml(path)


def move_streets(streets: Streets, origin: Origin) -> Streets:
    """Streets in local coordinates."""
    return replace(shift_streets(streets, -np.array(origin)), origin_m=origin)


def shift_streets(streets: Streets, offset_m: np.ndarray, decimals: int | None = None) -> Streets:
    """Streets moved by an offset (3,) [m], their coordinates rounded to a number of decimals."""

    def shift(points: np.ndarray) -> np.ndarray:
        moved = points + offset_m[: points.shape[-1]]
        return moved if decimals is None else moved.round(decimals)

    return replace(
        streets,
        lanes=tuple(replace(lane, centre=shift(lane.centre)) for lane in streets.lanes),
        areas=tuple(replace(area, outline=shift(area.outline)) for area in streets.areas),
        parking=tuple(replace(bay, centre=shift(bay.centre)) for bay in streets.parking),
        stop_lines=tuple(replace(stop, position=shift(stop.position)) for stop in streets.stop_lines),
        buildings=tuple(replace(house, outline=shift(house.outline)) for house in streets.buildings),
        trees=tuple((float(x), float(y)) for x, y in shift(np.array(streets.trees, float).reshape(-1, 2))),
    )


def _move(element: ET.Element, x: Decimal, y: Decimal) -> bool:
    """Move all coordinates of an element and below; whether there were any."""
    changed = False
    for each in element.iter():
        if each.get("geo") in ("1", "true"):
            continue
        for key in ("shape", "customShape", "outlineShape"):
            text = each.get(key)
            if text and "," in text:
                each.set(key, " ".join(_moved_point(point, x, y) for point in text.split()))
                changed = True
        if each.tag in _POINTS and each.get("x") and each.get("y"):
            each.set("x", _text(Decimal(each.get("x", "")) - x))
            each.set("y", _text(Decimal(each.get("y", "")) - y))
            changed = True
        if each.tag == "location":
            _move_location(each, x, y)
    return changed


def _move_location(location: ET.Element, x: Decimal, y: Decimal) -> None:
    for key, count in (("netOffset", 1), ("convBoundary", 2)):
        values = [Decimal(value) for value in location.get(key, "").split(",") if value]
        if len(values) == 2 * count:
            location.set(key, ",".join(_text(value - (y if at % 2 else x)) for at, value in enumerate(values)))


def _moved_point(point: str, x: Decimal, y: Decimal) -> str:
    east, north, *rest = point.split(",")
    return ",".join([_text(Decimal(east) - x), _text(Decimal(north) - y), *rest])


def _text(value: Decimal) -> str:
    return f"{value:f}"

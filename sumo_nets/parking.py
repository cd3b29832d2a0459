"""Parking lots in the strips between driving lane and sidewalk.

Every lot is a parkingArea of its own. SUMO fills an area of many lots from one end, and lets only one vehicle a step
start in it: the others drive in from its rear. With one lot each, all parked vehicles are in their spaces from the
first steps on, and which lots stay free is the demand's choice.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sumo_nets import polyline
from sumo_nets.lanes import points
from sumo_nets.plan import Plan, road_of
from sumo_nets.recipe import StreetRules
from sumo_nets.xml_guard import read_xml

_LOT_M = (5.8, 6.8)  # shortest and longest lot: a car and room to manoeuvre
_CLEAR_OF_JUNCTION_M = 7.0  # from the ends of the lane, for sight and turning
_DRIVEWAY_M = 5.5  # between two bays
_LOTS_PER_BAY = (2, 6)
_SLANTED_LOT_M = 2.7  # width of a slanted lot
_SLANTED_LENGTH_M = 5.0
_SLANTED_LOTS_PER_BAY = (4, 10)


@dataclass(frozen=True)
class Lot:
    """Kerbside parking for one vehicle.

    Attributes:
        id: SUMO parkingArea id, `lot_EDGE_NUMBER`.
        edge, lane: edge and lane that it is next to, on the right.
        start_m, end_m: positions along the lane.
        is_slanted: a car in it faces the kerb at an angle.
    """

    id: str
    edge: str
    lane: str
    start_m: float
    end_m: float
    is_slanted: bool = False


def make_parking(
    plan: Plan, rules: StreetRules, lane_lengths: dict[str, float], rng: np.random.Generator
) -> tuple[Lot, ...]:
    """Cut every parking strip into bays of a few lots with driveways between them.

    Args:
        plan: which streets have strips.
        rules: how streets are cut.
        lane_lengths: length in metres of every lane of the built network.
        rng: source of bay sizes.
    """
    lots: list[Lot] = []
    for street in plan.streets:
        beside = 2 if road_of(street, rules).sidewalk else 1  # lanes from the right: sidewalk, strip, driving lane
        for forward, wanted, slanted in zip((True, False), street.parking, street.slanted, strict=True):
            if wanted:
                edge = plan.edge(street, forward)
                lane = f"{edge}_{beside}"
                slanted_m = _SLANTED_LOT_M / math.sin(math.radians(rules.slanted_deg)) if slanted else None
                spans = _spans(lane_lengths[lane], slanted_m, rng)
                lots += [Lot(f"lot_{edge}_{i}", edge, lane, *span, slanted) for i, span in enumerate(spans)]
    return tuple(lots)


def slanted_strip_m(rules: StreetRules) -> float:
    """Return the width of a parking strip with slanted lots."""
    slant = math.radians(rules.slanted_deg)
    return _SLANTED_LENGTH_M * math.sin(slant) + _SLANTED_LOT_M * math.cos(slant)


def _spans(length_m: float, slanted_m: float | None, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return start and end of the lots next to a lane; `slanted_m` is the length of a slanted lot along it."""
    spans: list[tuple[float, float]] = []
    at = _CLEAR_OF_JUNCTION_M
    lot_m = _LOT_M if slanted_m is None else (slanted_m, slanted_m)
    fewest, most = _LOTS_PER_BAY if slanted_m is None else _SLANTED_LOTS_PER_BAY
    while at < length_m:
        for lot in rng.uniform(*lot_m, int(rng.integers(fewest, most + 1))):
            spans.append((at, at + lot))
            at += lot
        at += _DRIVEWAY_M
    return [span for span in spans if span[1] <= length_m - _CLEAR_OF_JUNCTION_M]


def write_parking(lots: tuple[Lot, ...], rules: StreetRules, network: Any) -> list[str]:
    """Return the lots as lines of an additional file.

    SUMO puts a parkingArea next to its lane: one of this width lies exactly on the closed lane of the same width.
    Slanted lots have a place and an angle of their own; SUMO would let cars in them extend into the lane.

    Args:
        lots: what to write.
        rules: how streets are cut.
        network: the built network, as sumolib reads it.
    """
    lines = []
    for lot in lots:
        span = f'startPos="{lot.start_m:.2f}" endPos="{lot.end_m:.2f}"'
        head = f'    <parkingArea id="{lot.id}" lane="{lot.lane}" {span} '
        if lot.is_slanted:
            lines += [f'{head}roadsideCapacity="0">', _slanted_space(lot, rules, network), "    </parkingArea>"]
        else:
            lines.append(f'{head}roadsideCapacity="1" width="{rules.parking_width_m}"/>')
    return lines


def _slanted_space(lot: Lot, rules: StreetRules, network: Any) -> str:
    """Return the `<space>` of a slanted lot: front end, and angle counter-clockwise from south."""
    lane = network.getLane(lot.lane)
    shape = points(lane.getShape3D())
    slant = math.radians(rules.slanted_deg)
    front_m = lane.getWidth() / 2 + slanted_strip_m(rules) - _SLANTED_LOT_M / 2 * math.cos(slant)
    scale = polyline.length(shape) / lane.getLength()
    middle_m = (lot.start_m + lot.end_m) / 2 * scale
    at = polyline.beside(shape, front_m, middle_m - 0.5, middle_m + 0.5)
    along = polyline.heading(at)
    forward = _SLANTED_LENGTH_M / 2 * math.cos(slant)
    x, y, z = at.mean(0) + forward * np.array([math.cos(along), math.sin(along), 0.0])
    angle = math.degrees(along - slant) + 90
    return (
        f'        <space x="{x:.2f}" y="{y:.2f}" z="{z:.2f}" angle="{angle:.1f}" '
        f'width="{_SLANTED_LOT_M}" length="{_SLANTED_LENGTH_M}"/>'
    )


def read_angled_parking(paths: Iterable[Path]) -> frozenset[str]:
    """Return the ids of the parking areas of additional files in which vehicles are not parallel to their lane."""
    areas = [area for path in paths for area in read_xml(path).iter("parkingArea")]
    return frozenset(
        area.get("id", "")
        for area in areas
        if area.find("space") is not None or float(area.get("angle", "0")) % 180 != 0
    )


def read_parking(paths: Iterable[Path]) -> tuple[Lot, ...]:
    """Return the roadside lots of additional files that hold one vehicle each; areas of other kinds are ignored."""
    areas = [area for path in paths for area in read_xml(path).iter("parkingArea")]
    return tuple(
        Lot(
            area.get("id", ""),
            area.get("lane", "").rpartition("_")[0],
            area.get("lane", ""),
            float(area.get("startPos", "0")),
            float(area.get("endPos", "0")),
            is_slanted=area.find("space") is not None,
        )
        for area in areas
        if (area.get("roadsideCapacity", "0"), len(area.findall("space"))) in (("1", 0), ("0", 1))
    )

"""Parking lots in the strips between driving lane and sidewalk.

Every lot is a parkingArea of its own. SUMO fills an area of many lots from one end, and lets only one vehicle a step
start in it: the others drive in from its rear. With one lot each, all parked vehicles are in their spaces from the
first steps on, and which lots stay free is the demand's choice.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sumo_nets.plan import Plan, road_of
from sumo_nets.recipe import StreetRules
from sumo_nets.xml_guard import read_xml

_LOT_M = (5.8, 6.8)  # shortest and longest lot: a car and room to manoeuvre
_CLEAR_OF_JUNCTION_M = 7.0  # from the ends of the lane, for sight and turning
_DRIVEWAY_M = 5.5  # between two bays
_LOTS_PER_BAY = (2, 6)


@dataclass(frozen=True)
class Lot:
    """Kerbside parking for one vehicle.

    Attributes:
        id: SUMO parkingArea id, `lot_EDGE_NUMBER`.
        edge, lane: edge and lane that it is next to, on the right.
        start_m, end_m: positions along the lane.
    """

    id: str
    edge: str
    lane: str
    start_m: float
    end_m: float


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
        for forward, wanted in zip((True, False), street.parking, strict=True):
            if wanted:
                edge = plan.edge(street, forward)
                lane = f"{edge}_{beside}"
                spans = _spans(lane_lengths[lane], rng)
                lots += [Lot(f"lot_{edge}_{i}", edge, lane, *span) for i, span in enumerate(spans)]
    return tuple(lots)


def _spans(length_m: float, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return start and end of the lots next to a lane."""
    spans: list[tuple[float, float]] = []
    at = _CLEAR_OF_JUNCTION_M
    while at < length_m:
        for lot in rng.uniform(*_LOT_M, int(rng.integers(_LOTS_PER_BAY[0], _LOTS_PER_BAY[1] + 1))):
            spans.append((at, at + lot))
            at += lot
        at += _DRIVEWAY_M
    return [span for span in spans if span[1] <= length_m - _CLEAR_OF_JUNCTION_M]


def write_parking(lots: tuple[Lot, ...], rules: StreetRules) -> list[str]:
    """Return the lots as lines of an additional file.

    SUMO puts a parkingArea next to its lane: one of this width lies exactly on the closed lane of the same width.
    """
    return [
        f'    <parkingArea id="{lot.id}" lane="{lot.lane}" startPos="{lot.start_m:.2f}" endPos="{lot.end_m:.2f}" '
        f'roadsideCapacity="1" width="{rules.parking_width_m}"/>'
        for lot in lots
    ]


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
        )
        for area in areas
        if area.get("roadsideCapacity") == "1"
    )

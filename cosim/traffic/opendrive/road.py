"""Geometry of an OpenDRIVE road: reference line, elevation, lane sections and widths.

ASAM OpenDRIVE 1.8, 10 (roads) and 11 (lanes). Cross-section shapes are not evaluated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cosim.errors import CosimError
from cosim.traffic.opendrive.plan_view import PlanView


class OpenDriveError(CosimError):
    """A road network that cannot be evaluated, or a location that it does not have."""


@dataclass(frozen=True, eq=False)
class Cubics:
    """A function of s by pieces, each a cubic polynomial of the distance from its start; 0 before the first.

    Attributes:
        start_s: (k,) ascending [m].
        coefficients: (k, 4) a, b, c, d.
    """

    start_s: np.ndarray
    coefficients: np.ndarray

    def at(self, s_m: float) -> float:
        """Value at s."""
        number = int(np.searchsorted(self.start_s, s_m + 1e-9, side="right")) - 1
        if number < 0:
            return 0.0
        a, b, c, d = self.coefficients[number].tolist()
        ds = s_m - float(self.start_s[number])
        return a + ds * (b + ds * (c + ds * d))


@dataclass(frozen=True, eq=False)
class Lane:
    """A lane within a lane section.

    Attributes:
        id: number: negative to the right of the reference line, positive to the left.
        type: OpenDRIVE's word, such as `driving`.
        width: width [m] over the distance from the section's start.
        border: where widths are not given: lateral position of the outer border [m], likewise.
        is_reversed: traffic runs against the usual direction of this side.
        predecessor: lane in the section, or road, before; None if there is none.
        successor: likewise after.
    """

    id: int
    type: str
    width: Cubics | None
    border: Cubics | None
    is_reversed: bool
    predecessor: int | None
    successor: int | None


@dataclass(frozen=True, eq=False)
class LaneSection:
    """Part of a road with the same lanes.

    Attributes:
        start_s: [m].
        sides: 1 (left), -1 (right), or both: sides that the section describes.
        lanes: by id, without the centre lane.
    """

    start_s: float
    sides: tuple[int, ...]
    lanes: Mapping[int, Lane]


@dataclass(frozen=True)
class RoadLink:
    """Road or junction at an end of a road.

    Attributes:
        kind: `road` or `junction`.
        id: of it.
        at_start: the linked road starts there, rather than ends; of no meaning for junctions.
    """

    kind: str
    id: str
    at_start: bool


@dataclass(frozen=True, eq=False)
class Road:
    """A road.

    Attributes:
        id: of the road.
        length_m: of the reference line.
        junction: id of the junction that the road is part of; empty without one.
        keeps_left: left-hand traffic.
        plan_view: reference line.
        elevation, superelevation, lane_offset: height [m], roll [rad] and shift of the centre lane [m] over s.
        sections: lane sections in the order of s.
        predecessor, successor: what is linked at the ends.
    """

    id: str
    length_m: float
    junction: str
    keeps_left: bool
    plan_view: PlanView
    elevation: Cubics
    superelevation: Cubics
    lane_offset: Cubics
    sections: tuple[LaneSection, ...]
    predecessor: RoadLink | None
    successor: RoadLink | None

    def section_at(self, s_m: float, lane_id: int) -> int:
        """Number of the lane section that describes a lane's side at s."""
        side = 1 if lane_id > 0 else -1
        valid = [number for number, section in enumerate(self.sections) if side in section.sides or lane_id == 0]
        before = [number for number in valid if self.sections[number].start_s <= s_m + 1e-7]
        return before[-1] if before else valid[0] if valid else 0

    def stretch(self, s_m: float, lane_id: int, travel: int) -> tuple[float, float]:
        """Start and end [m] of the lane section at s, of the one ahead in the direction of travel where two meet."""
        side = 1 if lane_id > 0 else -1
        starts = [section.start_s for section in self.sections if side in section.sides]
        inner = [start for start in starts if 1e-5 < start < self.length_m - 1e-5]
        bounds = [0.0, *(inner if lane_id else ()), self.length_m]
        ahead = s_m + travel * 1e-6
        before = [bound for bound in bounds[:-1] if bound <= ahead]
        number = len(before) - 1 if before else 0
        return bounds[number], bounds[number + 1]

    def lane_before(self, s_m: float, lane_id: int, travel: int) -> Lane | None:
        """A lane of the section that is left at s, in the direction of travel."""
        return self.lane_at(s_m - travel * 1e-5, lane_id)

    def lane_at(self, s_m: float, lane_id: int) -> Lane | None:
        """A lane at s; None where the road has no such lane, as for the centre lane 0."""
        return self.sections[self.section_at(s_m, lane_id)].lanes.get(lane_id) if self.sections else None

    def lane_middle_m(self, s_m: float, lane_id: int) -> float:
        """Lateral position t of the middle of a lane, to the left of the reference line [m].

        Raises:
            OpenDriveError: the road has no such lane there.
        """
        if lane_id == 0:
            return self.lane_offset.at(s_m)
        inner, outer = self._borders_m(s_m, lane_id)
        return (inner + outer) / 2

    def _borders_m(self, s_m: float, lane_id: int) -> tuple[float, float]:
        """Inner and outer border of a lane, as lateral positions t."""
        section = self.sections[self.section_at(s_m, lane_id)] if self.sections else None
        side = 1 if lane_id > 0 else -1
        if section is None or lane_id not in section.lanes:
            known = ", ".join(str(each) for each in sorted(self._lane_ids(s_m))) or "none"
            raise OpenDriveError(f"road {self.id!r} has no lane {lane_id} at s = {s_m:g} m; its lanes there: {known}")
        origin = self.lane_offset.at(s_m)
        inner = outer = origin
        for number in range(side, lane_id + side, side):
            inner, lane = outer, section.lanes.get(number)
            if lane is None:
                raise OpenDriveError(
                    f"road {self.id!r}: lane {number} is missing next to lane {lane_id}, s = {s_m:g} m"
                )
            ds = s_m - section.start_s
            if lane.width is not None:
                outer = inner + side * lane.width.at(ds)
            elif lane.border is not None:
                outer = origin + lane.border.at(ds)
        return inner, outer

    def _lane_ids(self, s_m: float) -> set[int]:
        return {
            lane_id
            for side in (1, -1)
            for lane_id in (self.sections[self.section_at(s_m, side)].lanes if self.sections else {})
            if lane_id * side > 0
        }

    def adjacent_lane(self, s_m: float, t_m: float) -> int:
        """Lane at a lateral position t; the outermost of that side for locations outside the road, 0 without any."""
        side = 1 if t_m > self.lane_offset.at(s_m) else -1
        lanes = sorted((lane for lane in self._lane_ids(s_m) if lane * side > 0), key=abs)
        for lane_id in lanes:
            inner, outer = self._borders_m(s_m, lane_id)
            if min(inner, outer) <= t_m <= max(inner, outer):
                return lane_id
        return lanes[-1] if lanes else 0

    def direction(self, s_m: float, lane_id: int) -> int:
        """Direction of traffic on a lane: 1 along s, -1 against it."""
        lane = self.lane_at(s_m, lane_id)
        usual = -1 if (lane_id > 0) != self.keeps_left else 1
        return -usual if lane is not None and lane.is_reversed else usual

    def pose(self, s_m: float, t_m: float) -> tuple[float, float, float, float]:
        """x, y, z [m] and heading of the reference line [rad] at road coordinates s, t."""
        x, y, heading = self.plan_view.at(np.array([s_m]))[0].tolist()
        roll = self.superelevation.at(s_m)
        aside, up = t_m * np.cos(roll), t_m * np.sin(roll)
        return (
            x - aside * float(np.sin(heading)),
            y + aside * float(np.cos(heading)),
            self.elevation.at(s_m) + float(up),
            heading,
        )

"""Geometry of a street network, for the world builder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

LaneUse = Literal["drive", "cycle", "tram", "sidewalk", "crossing"]


@dataclass(frozen=True)
class StreetLane:
    """One lane of the network.

    Attributes:
        id: SUMO lane id.
        edge: SUMO edge id.
        use: road users of the lane.
        centre: (k, 3) float64 centre line in driving direction, world metres.
        width_m: full width.
        speed_mps: speed limit.
        internal: true for a connection inside a junction.
        tracks: whether rails of a tram lie in the lane.
    """

    id: str
    edge: str
    use: LaneUse
    centre: np.ndarray
    width_m: float
    speed_mps: float
    internal: bool
    tracks: bool = False


@dataclass(frozen=True)
class StreetArea:
    """A paved polygon: a junction or a walking area.

    Attributes:
        id: SUMO id.
        use: `junction` (carriageway) or `walkingarea` (pavement).
        outline: (k, 3) float64 corners, world metres, not closed.
    """

    id: str
    use: Literal["junction", "walkingarea"]
    outline: np.ndarray


@dataclass(frozen=True)
class ParkingBay:
    """A strip of parking spaces along a lane.

    Attributes:
        id: SUMO parkingArea id.
        centre: (k, 3) float64 centre line of the strip, world metres.
        width_m: strip width.
        is_space: a single lot with a direction of its own: from its rear to its front.
    """

    id: str
    centre: np.ndarray
    width_m: float
    is_space: bool = False


@dataclass(frozen=True)
class StopLine:
    """End of a lane at a junction that controls it.

    Attributes:
        lane: SUMO lane id.
        position: (3,) world metres, end of the lane's centre line.
        heading_rad: driving direction at the line, counter-clockwise from east.
        control: `signal` (traffic light), `stop` or `yield`.
    """

    lane: str
    position: np.ndarray
    heading_rad: float
    control: Literal["signal", "stop", "yield"]


@dataclass(frozen=True)
class StreetBuilding:
    """A building defined in the town's files.

    Attributes:
        id: SUMO id.
        outline: (k, 2) float64 corners, world metres, not closed.
        height_m: height of its walls; None if unknown.
    """

    id: str
    outline: np.ndarray
    height_m: float | None


@dataclass(frozen=True)
class Streets:
    """A street network.

    Attributes:
        name: the town's name.
        lanes, areas, parking, stop_lines: its parts.
        style: what the town looks like, read by the world builder: `village`, `hamlet`, `suburb`,
            `urban`, `industrial` or `boulevard`.
        left_hand: whether one drives on the left.
        buildings: buildings defined in the town's files; if there are any, no others are built.
        trees: (x, y) of trees defined in the files [m].
        origin_m: x, y, z of the local origin in the coordinates of the network's files [m]; add it to get those.
        has_buildings: whether the town's files define buildings, even if none of them is in `buildings` because only a
            part of the town is built.
    """

    name: str
    lanes: tuple[StreetLane, ...]
    areas: tuple[StreetArea, ...]
    parking: tuple[ParkingBay, ...]
    stop_lines: tuple[StopLine, ...]
    style: str = "suburb"
    left_hand: bool = False
    buildings: tuple[StreetBuilding, ...] = ()
    trees: tuple[tuple[float, float], ...] = ()
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    has_buildings: bool = False

    @property
    def defines_buildings(self) -> bool:
        """Whether the buildings are given, so that none is drawn at random."""
        return self.has_buildings or bool(self.buildings)

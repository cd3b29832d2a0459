"""A mast beside the road that carries the sensors, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.streets import StreetLane, Streets
from cosim.capture.config import MastPlace
from cosim.drives.twin import Ego
from cosim.errors import CosimError
from cosim.scene.ground import Ground

_FROM_END_M, _SHORTEST_M = 3.0, 15.0
_BESIDE_M = 1.0
_NEAREST = 5  # pavements near somebody who drives, of which one is taken


class MastError(CosimError):
    """There is no place for a mast."""


@dataclass(frozen=True)
class Mast:
    """Where a mast stands.

    Attributes:
        x_m, y_m: its foot, axes of the town.
        z_m: about the height of the ground there.
        heading_rad: of its x axis, counter-clockwise from east.
    """

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float

    def ego(self, ground: Ground) -> Ego:
        """What the twin says of it: it stands upright and still."""
        pose = np.eye(4)
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        pose[:2, :2] = [[cos, -sin], [sin, cos]]
        pose[:2, 3] = self.x_m, self.y_m
        pose[2, 3] = float(ground.height(np.array([[self.x_m, self.y_m, self.z_m]]))[0])
        return Ego(pose, np.zeros(3), 0.0, np.zeros(3))


def stand_mast(streets: Streets, wanted: MastPlace | None, traffic: np.ndarray, rng: np.random.Generator) -> Mast:
    """A mast where it is wanted, or at the end of a pavement near some traffic, looking at what comes.

    Args:
        streets: of the town.
        wanted: its place; None: any.
        traffic: (n, 2) where somebody drives, axes of the town [m].
        rng: chooses.

    Raises:
        MastError: the place is not in the town, or the town has no street that is long enough.
    """
    lanes = [lane for lane in streets.lanes if not lane.internal]
    if wanted is not None:
        return _wanted(lanes, wanted)
    walks = [lane for lane in lanes if lane.use == "sidewalk"] or [lane for lane in lanes if lane.use == "drive"]
    places = [place for lane in walks if (place := _at_end(lane)) is not None]
    if not places:
        raise MastError(f"{streets.name}: no street is {_SHORTEST_M:g} m long, so a mast has no place; give `mast`")
    where = np.array([(place.x_m, place.y_m) for place in places])
    away = np.linalg.norm(where[:, None] - traffic[None], axis=2).min(1) if len(traffic) else np.zeros(len(places))
    nearest = np.argsort(away, kind="stable")[:_NEAREST]
    return places[int(rng.choice(nearest))]


def _wanted(lanes: list[StreetLane], wanted: MastPlace) -> Mast:
    points = np.concatenate([lane.centre for lane in lanes])
    here = np.array([wanted.x_m, wanted.y_m])
    low, high = points[:, :2].min(0) - 50, points[:, :2].max(0) + 50
    if not ((low <= here) & (here <= high)).all():
        raise MastError(
            f"mast: ({wanted.x_m:g}, {wanted.y_m:g}) m lies outside the town, which reaches from "
            f"({low[0] + 50:.0f}, {low[1] + 50:.0f}) to ({high[0] - 50:.0f}, {high[1] - 50:.0f}) m; stand it there"
        )
    nearest = points[np.argmin(np.linalg.norm(points[:, :2] - here, axis=1))]
    return Mast(wanted.x_m, wanted.y_m, float(nearest[2]), float(np.radians(wanted.heading_deg)))


def _at_end(lane: StreetLane) -> Mast | None:
    """At the end of a pavement, or beside that of a lane, looking back along it."""
    steps = np.linalg.norm(np.diff(lane.centre[:, :2], axis=0), axis=1)
    if steps.sum() < _SHORTEST_M:
        return None
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = steps.sum() - _FROM_END_M
    x, y, z = (float(np.interp(at, along, lane.centre[:, axis])) for axis in range(3))
    before = [float(np.interp(at - _SHORTEST_M / 2, along, lane.centre[:, axis])) for axis in range(2)]
    back = np.arctan2(before[1] - y, before[0] - x)
    if lane.use == "drive":  # to the right of who drives
        aside = lane.width_m / 2 + _BESIDE_M
        x, y = x - aside * float(np.sin(back)), y + aside * float(np.cos(back))
    return Mast(x, y, z, float(back))

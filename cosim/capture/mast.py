"""Position of a roadside mast that carries the sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.streets import StreetLane, Streets
from cosim.capture.config import MastPosition
from cosim.drives.twin import Ego
from cosim.errors import CosimError
from cosim.scene.ground import Ground

_FROM_END_M, _MIN_LENGTH_M = 3.0, 15.0
_LATERAL_OFFSET_M = 1.0
_NEAREST = 5  # number of candidates nearest to traffic from which the position is drawn


class MastError(CosimError):
    """There is no suitable position for a mast."""


@dataclass(frozen=True)
class Mast:
    """Pose of a mast.

    Attributes:
        x_m, y_m: position of its foot in the axes of the town [m].
        z_m: approximate height of the ground there [m].
        heading_rad: direction of its x axis, counter-clockwise from east [rad].
    """

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float

    def ego(self, ground: Ground) -> Ego:
        """The mast as the twin's ego: upright and at rest."""
        pose = np.eye(4)
        cos, sin = np.cos(self.heading_rad), np.sin(self.heading_rad)
        pose[:2, :2] = [[cos, -sin], [sin, cos]]
        pose[:2, 3] = self.x_m, self.y_m
        pose[2, 3] = float(ground.height(np.array([[self.x_m, self.y_m, self.z_m]]))[0])
        return Ego(pose, np.zeros(3), 0.0, np.zeros(3))


def choose_mast(streets: Streets, wanted: MastPosition | None, traffic: np.ndarray, rng: np.random.Generator) -> Mast:
    """Place a mast at the requested position, or at the end of a pavement near traffic, facing oncoming vehicles.

    Args:
        streets: streets of the town.
        wanted: requested position; None: draw one.
        traffic: (n, 2) positions of moving vehicles in the axes of the town [m].
        rng: generator that draws the position.

    Raises:
        MastError: the position is outside the town, or no street of the town is long enough.
    """
    lanes = [lane for lane in streets.lanes if not lane.internal]
    if wanted is not None:
        return _pose_at(lanes, wanted)
    walks = [lane for lane in lanes if lane.use == "sidewalk"] or [lane for lane in lanes if lane.use == "drive"]
    masts = [mast for lane in walks if (mast := _pose_at_end(lane)) is not None]
    if not masts:
        raise MastError(
            f"{streets.name}: no street is at least {_MIN_LENGTH_M:g} m long, so no position can be chosen; give `mast`"
        )
    positions = np.array([(mast.x_m, mast.y_m) for mast in masts])
    distance = (
        np.linalg.norm(positions[:, None] - traffic[None], axis=2).min(1) if len(traffic) else np.zeros(len(masts))
    )
    nearest = np.argsort(distance, kind="stable")[:_NEAREST]
    return masts[int(rng.choice(nearest))]


def _pose_at(lanes: list[StreetLane], wanted: MastPosition) -> Mast:
    points = np.concatenate([lane.centre for lane in lanes])
    position = np.array([wanted.x_m, wanted.y_m])
    low, high = points[:, :2].min(0) - 50, points[:, :2].max(0) + 50
    if not ((low <= position) & (position <= high)).all():
        raise MastError(
            f"mast: ({wanted.x_m:g}, {wanted.y_m:g}) m is outside the town, which extends from "
            f"({low[0] + 50:.0f}, {low[1] + 50:.0f}) to ({high[0] - 50:.0f}, {high[1] - 50:.0f}) m; give a position "
            "within it"
        )
    nearest = points[np.argmin(np.linalg.norm(points[:, :2] - position, axis=1))]
    return Mast(wanted.x_m, wanted.y_m, float(nearest[2]), float(np.radians(wanted.heading_deg)))


def _pose_at_end(lane: StreetLane) -> Mast | None:
    """Place a mast at the end of a pavement, or next to the end of a lane, facing back along it."""
    steps = np.linalg.norm(np.diff(lane.centre[:, :2], axis=0), axis=1)
    if steps.sum() < _MIN_LENGTH_M:
        return None
    along = np.concatenate([[0.0], np.cumsum(steps)])
    at = steps.sum() - _FROM_END_M
    x, y, z = (float(np.interp(at, along, lane.centre[:, axis])) for axis in range(3))
    before = [float(np.interp(at - _MIN_LENGTH_M / 2, along, lane.centre[:, axis])) for axis in range(2)]
    back = np.arctan2(before[1] - y, before[0] - x)
    if lane.use == "drive":  # to the right of the lane
        offset = lane.width_m / 2 + _LATERAL_OFFSET_M
        x, y = x - offset * float(np.sin(back)), y + offset * float(np.cos(back))
    return Mast(x, y, z, float(back))

"""Places signals, signs and lamps along the kerbs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.mesh import Mesh
from assets.streets import StopLine, StreetLane, Streets
from assets.world import polylines
from assets.world.furniture import signs, street_furniture
from assets.world.ground.overlays import Heights
from assets.world.instancing import instances, poses
from assets.world.obstacles import Obstacles
from assets.world.roads.kerbside import Kerbside
from assets.world.styles import TownStyle

_KERB_SETBACK_M = 0.4  # distance of poles from the kerb
_MAST_ARM_FROM_LANES = 2
_SEARCH_M = np.arange(0.35, 12.0, 0.35)


@dataclass(frozen=True, eq=False)
class SignalHead:
    """Three lamps of a signal.

    Attributes:
        lane: SUMO id of the lane whose signal it shows.
        pose: (4, 4) world pose of its middle; who it is for looks along its x.
    """

    lane: str
    pose: np.ndarray


def props_mesh(
    streets: Streets, edge: Kerbside, blocked: Obstacles, stand_z: Heights, style: TownStyle, rng: np.random.Generator
) -> tuple[Mesh, tuple[SignalHead, ...]]:
    """Signals, signs and lamps, and the heads of the signals; `stand_z` gives the height of the ground at a point."""
    controls, heads = _controls(streets, blocked, stand_z)
    rest = [_speed_signs(streets, blocked, stand_z, rng), _lamps(edge, blocked, stand_z, style, rng)]
    return Mesh.merge([controls, *rest]), heads


def _controls(streets: Streets, blocked: Obstacles, stand_z: Heights) -> tuple[Mesh, tuple[SignalHead, ...]]:
    """A signal, stop or yield sign on the kerb's side of every controlled approach."""
    lanes = {lane.id: lane for lane in streets.lanes}
    approaches: dict[str, list[StopLine]] = {}
    for stop in streets.stop_lines:
        approaches.setdefault(lanes[stop.lane].edge if stop.lane in lanes else stop.lane, []).append(stop)
    placed: dict[tuple[str, float], list[np.ndarray]] = {}
    heads: list[SignalHead] = []
    for stops in approaches.values():
        stop = min(stops, key=_lane_number)
        width = sum(lanes[s.lane].width_m if s.lane in lanes else 3.2 for s in stops)
        spot = _behind_kerb(stop.position[:2], stop.heading_rad, streets.left_hand, blocked)
        if spot is None:
            continue
        reach = 0.0
        if stop.control == "signal" and len(stops) >= _MAST_ARM_FROM_LANES:
            reach = round(float(np.linalg.norm(spot[0] - stop.position[:2])) + width / 2 - 1.6)
        pose = poses(np.column_stack([spot, stand_z(spot)]), stop.heading_rad)
        placed.setdefault((stop.control, reach), []).append(pose)
        if stop.control == "signal":
            heads += _heads(stop.lane, pose[0], reach, streets.left_hand)
    parts = []
    for control, reach in sorted(placed):
        model = signs.signal_pole(reach, left_hand=streets.left_hand) if control == "signal" else signs.sign(control)
        parts.append(instances(model, np.concatenate(placed[control, reach])))
    return Mesh.merge(parts), tuple(heads)


def _heads(lane: str, pole: np.ndarray, reach_m: float, left_hand: bool) -> list[SignalHead]:
    """The heads on a pole with a world pose (4, 4)."""
    found = []
    for position in signs.head_positions(reach_m, left_hand=left_hand):
        pose = pole.copy()
        pose[:3, 3] += pole[:3, :3] @ position
        found.append(SignalHead(lane, pose))
    return found


def _lane_number(stop: StopLine) -> int:
    tail = stop.lane.rsplit("_", 1)[-1]
    return int(tail) if tail.isdigit() else 0


def _behind_kerb(position: np.ndarray, heading_rad: float, left: bool, blocked: Obstacles) -> np.ndarray | None:
    """The first free spot (1, 2) to the right or left of a lane, reserved; None if there is none."""
    aside = np.array([np.sin(heading_rad), -np.cos(heading_rad)]) * (-1.0 if left else 1.0)
    spots = position + aside * (_SEARCH_M[:, None] + 1.0)
    free = blocked.free(spots, 0.3, road_m=0.3, fits_below_decks=True)
    for spot in spots[free][:6]:
        if blocked.take(spot[None], 0.25)[0]:
            return spot[None]
    return None


def _speed_signs(streets: Streets, blocked: Obstacles, stand_z: Heights, rng: np.random.Generator) -> Mesh:
    """Speed, parking, warning and direction signs some way into some streets."""
    first_lanes: dict[str, StreetLane] = {}
    for lane in streets.lanes:
        if lane.use == "drive" and not lane.internal:
            first_lanes.setdefault(lane.edge, lane)
    placed: dict[tuple[str, str], list[np.ndarray]] = {}
    for lane in first_lanes.values():
        total = polylines.stations(lane.centre)[-1]
        for station in rng.uniform(8.0, max(total - 15.0, 9.0), rng.poisson(0.9)):
            kind = str(rng.choice(["speed", "speed", "parking", "warning", "direction"]))
            ahead = polylines.headings(lane.centre, np.array([station]))[0]
            heading = float(np.arctan2(ahead[1], ahead[0]))
            spot = _behind_kerb(polylines.at(lane.centre, np.array([station]))[0], heading, streets.left_hand, blocked)
            if spot is not None:
                limit = str(round(lane.speed_mps * 3.6 / 10) * 10) if kind == "speed" else ""
                placed.setdefault((kind, limit), []).append(poses(np.column_stack([spot, stand_z(spot)]), heading))
    return Mesh.merge(
        [instances(signs.sign(kind, text=limit), np.concatenate(placed[kind, limit])) for kind, limit in sorted(placed)]
    )


def _lamps(edge: Kerbside, blocked: Obstacles, stand_z: Heights, style: TownStyle, rng: np.random.Generator) -> Mesh:
    rows = edge.every(style.lamp_gap_m, rng)
    lamp = street_furniture.street_lamp(float(rng.uniform(5.0, 8.0)), float(rng.uniform(0.6, 1.6)))
    return _at_kerb(lamp, rows, _KERB_SETBACK_M, 0.3, edge, blocked, stand_z)


def _at_kerb(
    model: Mesh, rows: np.ndarray, setback_m: np.ndarray | float, radius_m: float,
    edge: Kerbside, blocked: Obstacles, stand_z: Heights,
) -> Mesh:  # fmt: skip
    """Copies of a model behind the kerb at the given rows, where there is room."""
    spots = edge.point[rows] + edge.outward[rows] * np.broadcast_to(setback_m, len(rows))[:, None]
    keep = blocked.free(spots, min(radius_m, 0.3), road_m=0.2)
    keep[keep] = blocked.take(spots[keep], radius_m)
    spots = spots[keep]
    return instances(model, poses(np.column_stack([spots, stand_z(spots)]), edge.yaw_rad[rows][keep]))

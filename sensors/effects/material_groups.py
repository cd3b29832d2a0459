"""Groups of materials for effects on surfaces, and positions of returns on their surfaces."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np

from assets.materials import MaterialTable
from sensors.returns import Returns
from sensors.shot import Shot

Group = Literal["road", "ground", "vegetation", "building", "vehicle", "other", "verge"]
_BETWEEN_TEXTURES_M = np.array([389.0, 467.0, 0.0])  # no multiple of the fields' periods
_NAMES = {
    "ground": ("kerb", "paving", "cobble", "gravel", "grass", "soil"),
    "verge": ("gravel", "grass", "soil"),  # part of ground
    "vegetation": ("bark", "foliage", "foliage_dark", "hedge"),
    "building": (
        *("plaster_white", "plaster_yellow", "plaster_grey", "plaster_red", "brick", "concrete", "stone"),
        *("cladding_metal", "roof_tile", "roof_slate", "roof_flat", "window_frame", "room_interior", "door", "wood"),
    ),
    "vehicle": (
        *("car_paint", "car_trim", "car_interior", "car_seat", "underbody", "tyre", "wheel_rim", "chrome", "mirror"),
        *("tarpaulin", "cargo_box"),
    ),
}
GROUPS: tuple[Group, ...] = ("road", "ground", "vegetation", "building", "vehicle", "other", "verge")


def rows_of_group(group: Group, returns: Returns, shot: Shot) -> np.ndarray:
    """Rows (k,) of the returns from surfaces of a group; `other`: materials of no group except retro-reflectors."""
    return np.flatnonzero(group_members(group, shot.hits.table)[returns.material] & (returns.instance >= -1))


def points_on_surface(returns: Returns, shot: Shot) -> np.ndarray:
    """Places (m, 3) float32 of returns: in the world, or in the axes of the object that they are on [m].

    Positions are shifted by a vector that depends on the object's id: objects of one model have different surfaces.
    Another realisation of the texture (`Shot.texture`) is the same field elsewhere.
    """
    shift_m = shot.texture * _BETWEEN_TEXTURES_M
    if np.array_equal(returns.range_m, shot.hits.solid.range_m[returns.beam]):  # no effect has changed the ranges
        places = shot.kept(f"positions in texture {shot.texture}", lambda: _positions_by_beam(shot, shift_m))
        return places.take(returns.beam, axis=0)
    return (_positions(returns, shot) + shift_m).astype(np.float32)


def _positions_by_beam(shot: Shot, shift_m: np.ndarray) -> np.ndarray:
    """Positions (n, 3) float32 [m] of the solid surfaces that the beams hit; 0 for beams without one."""
    places = np.zeros((len(shot.rays), 3), np.float32)
    positions = shot.kept("positions on surfaces", lambda: _positions(shot.solids, shot))
    places[shot.solids.beam] = positions + shift_m
    return places


def _positions(returns: Returns, shot: Shot) -> np.ndarray:
    """Positions (m, 3) float64 [m] of returns in the texture of the world, as `points_on_surface`."""
    points = shot.points_in_world(returns)
    rows = np.flatnonzero(returns.instance >= 0)
    instances, row = shot.instances, returns.instance[rows]
    if instances is None or not len(rows):
        return points
    on = returns.take(rows)
    time_s = np.broadcast_to(shot.time_s(on), len(rows)).astype(np.float64)
    arm = points[rows] - instances.poses[row, :3, 3] - instances.velocity_mps[row] * time_s[:, None]
    angle = -instances.yaw_rate_radps[row] * time_s
    cos, sin = np.cos(angle), np.sin(angle)
    arm[:, 0], arm[:, 1] = cos * arm[:, 0] - sin * arm[:, 1], sin * arm[:, 0] + cos * arm[:, 1]
    points[rows] = (
        np.einsum("nji,nj->ni", instances.poses[row, :3, :3], arm) + shift_of_instance(instances.ids)[row, None]
    )
    return points


def shift_of_instance(ids: Sequence[str]) -> np.ndarray:
    """Shift (n,) of surfaces of the objects with these ids, along each of their axes [m]."""
    return np.array([zlib.crc32(name.encode()) % 4096 for name in ids], float)


@lru_cache(maxsize=64)
def group_members(group: Group, table: MaterialTable) -> np.ndarray:
    """Materials of a group, (k,) bool by row of the table."""
    road, retro = table.column("road"), table.column("retro")
    if group == "road":
        return road & ~retro
    if group == "other":
        named = road | np.isin(table.names, [name for names in _NAMES.values() for name in names])
        return ~named & ~retro
    return np.isin(table.names, _NAMES[group])

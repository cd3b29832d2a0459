"""Names that data sets give to the columns of trajectory tables, and the units that a name declares."""

from __future__ import annotations

import math
from collections.abc import Sequence

_DEG = math.pi / 180
_FOOT = 0.3048

#: Role → name → unit in SI that the name declares; None where it declares none.
NAMES: dict[str, dict[str, float | None]] = {
    "time": {"time_s": 1, "timestamp_s": 1, "t_s": 1, "timestep_time": 1, "time_ms": 1e-3, "timestamp_ms": 1e-3}
    | {"time_us": 1e-6, "timestamp_us": 1e-6, "time_ns": 1e-9, "timestamp_ns": 1e-9}
    | {"timestamp": None, "time": None, "t": None, "time_stamp": None, "global_time": None},
    "frame": {"frame_id": None, "timestep": None, "frame": None, "frame_number": None, "frameid": None, "step": None},
    "id": {
        "id": None,
        "track_id": None,
        "vehicle_id": None,
        "person_id": None,
        "object_id": None,
        "trackid": None,
        "agent_id": None,
    },
    "x": {"x_m": 1, "tx_m": 1, "x_ft": _FOOT, "x": None, "position_x": None, "center_x": None, "xcenter": None}
    | {"x_utm": None, "pos_x": None},
    "y": {"y_m": 1, "ty_m": 1, "y_ft": _FOOT, "y": None, "position_y": None, "center_y": None, "ycenter": None}
    | {"y_utm": None, "pos_y": None},
    "z": {"z_m": 1, "tz_m": 1, "z_ft": _FOOT, "z": None, "position_z": None, "center_z": None},
    "heading": {"heading_deg": _DEG, "yaw_deg": _DEG, "psi_deg": _DEG, "heading_rad": 1, "psi_rad": 1, "yaw_rad": 1}
    | {"heading": None, "yaw": None, "psi": None, "angle": None, "orientation": None},
    "speed": {"speed_mps": 1, "speed_kmh": 1 / 3.6, "speed_kph": 1 / 3.6, "speed_mph": 0.44704, "v_mps": 1}
    | {"speed": None, "velocity": None, "v": None, "v_vel": None},
    "vx": {"vx_mps": 1, "velocity_x": None, "vx": None, "xvelocity": None, "v_x": None},
    "vy": {"vy_mps": 1, "velocity_y": None, "vy": None, "yvelocity": None, "v_y": None},
    "length": {"length_m": 1, "length_ft": _FOOT, "length": None},
    "width": {"width_m": 1, "width_ft": _FOOT, "width": None},
    "height": {"height_m": 1, "height_ft": _FOOT, "height": None},
    "type": {"type": None, "object_type": None, "agent_type": None, "class": None, "category": None},
    "lane": {"lane": None, "lane_id": None},
    "valid": {"valid": None, "observed_valid": None},
}
NEEDED = ("id", "x", "y")
_WORDS = frozenset({"id", "type", "lane", "valid"})
_SUMO_PREFIX, _SUMO_TIME = "vehicle_", "timestep_time"
#: The table of the traffic loop: positions of front bumpers.
LOOP = frozenset({"time_s", "id", "x_m", "y_m", "speed_mps", "heading_deg", "lane", "type"})
#: Argoverse 2 motion forecasting (Wilson et al., NeurIPS 2021): `timestep` counts tenths of a second.
_ARGOVERSE = frozenset({"scenario_id", "track_id", "timestep", "position_x", "position_y"})
_ARGOVERSE_HZ = 10.0


def named_columns(header: Sequence[str], role: str) -> list[str]:
    """Columns whose names mean a role, those that declare a unit first."""
    known = NAMES[role]
    by_name = {_plain(name, header): name for name in header}
    found = [by_name[name] for name in known if name in by_name]
    return sorted(found, key=lambda name: known[_plain(name, header)] is None)


def _plain(name: str, header: Sequence[str]) -> str:
    """A name in lower case, without the prefix that SUMO's tables have."""
    lower = name.strip().lower()
    return lower.removeprefix(_SUMO_PREFIX) if is_sumo_table(header) else lower


def is_sumo_table(header: Sequence[str]) -> bool:
    """Whether a header is that of SUMO's `--fcd-output FILE.csv`."""
    names = {name.strip().lower() for name in header}
    return _SUMO_TIME in names and f"{_SUMO_PREFIX}x" in names


def needs_numbers(name: str) -> bool:
    """Whether a column of this name holds numbers."""
    lower = name.strip().lower()
    return any(
        lower in names or lower.removeprefix(_SUMO_PREFIX) in names
        for role, names in NAMES.items()
        if role not in _WORDS
    )


def declared_unit(role: str, column: str) -> float | None:
    """Unit in SI that a column's name declares."""
    return NAMES[role].get(column.strip().lower())


def documented_rate_hz(header: Sequence[str]) -> float | None:
    """Frames a second of a data set that the header as a whole identifies."""
    return _ARGOVERSE_HZ if {name.strip().lower() for name in header} >= _ARGOVERSE else None


def possible_names(roles: Sequence[str]) -> str:
    """For messages: which names mean which roles."""
    return "; ".join(f"{role}: {', '.join(NAMES[role])}" for role in roles)

"""Meaning of the columns of a trajectory table: time and its unit, headings, speeds, axes, each by two clues.

Independent clues are compared: how far road users move between samples, the speeds the table states, the directions in
which they move, the headings it states, ordinary rates of recording and speeds of traffic, and the size of stamps since
1970. A reading is taken where its clues agree, and noted. Where they do not, an error names the readings and the option
(`TABLE.yaml`, see `table_options.py`) that settles it. All statistics are medians and quantiles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim.traffic.trajectories.table_heading import infer_heading
from cosim.traffic.trajectories.table_names import (
    LOOP,
    NEEDED,
    declared_unit,
    is_sumo_table,
    named_columns,
    possible_names,
)
from cosim.traffic.trajectories.table_options import TableOptions
from cosim.traffic.trajectories.table_steps import (
    TableColumns,
    TableSteps,
    check_velocity_direction,
    drop_constant_speeds,
    stated_speed,
)
from cosim.traffic.trajectories.table_time import infer_time
from cosim.traffic.trajectories.tracks import TrajectoryError

_CAR_M = (3.0, 6.5)  # median length of cars


@dataclass(frozen=True)
class TableSchema:
    """Meaning and units of a table's columns.

    Attributes:
        columns: name of the column of each role (time, id, x, y, z, heading, speed, vx, vy, length, …).
        time_unit_s: one unit of the time column [s].
        metres: one unit of x, y and z [m].
        length_unit_m: one unit of length, width and height [m].
        speed_unit_mps: one unit of speed, vx, vy [m/s].
        heading_unit_rad: one unit of the headings [rad].
        heading_zero: `east` (counter-clockwise) or `north` (clockwise, as SUMO counts).
        position: `middle` or `front` of a vehicle.
        axes: which stored axes point east and north, as `x,-y`.
        notes: what was inferred, and by which clues, a sentence each.
    """

    columns: Mapping[str, str]
    time_unit_s: float
    metres: float = 1.0
    length_unit_m: float = 1.0
    speed_unit_mps: float = 1.0
    heading_unit_rad: float = 1.0
    heading_zero: str = "east"
    position: str = "middle"
    axes: str = "x,y"
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """For `inferred:` in `drive.yaml`."""
        values = {key: value for key, value in vars(self).items() if key not in ("columns", "notes")}
        return {"columns": dict(self.columns)} | values | {"notes": list(self.notes)}


def infer_table_schema(table: TableColumns, source: str, options: TableOptions | None = None) -> TableSchema:
    """The schema on which independent clues agree.

    Args:
        table: its numeric columns.
        source: name of the file, for messages.
        options: statements of the user, which are taken without a check.

    Raises:
        TrajectoryError: a column is missing, or clues contradict each other.
    """
    options = options or TableOptions()
    notes: list[str] = []
    columns = _plain_roles(table.header, source, options)
    metres = options.metres or declared_unit("x", columns["x"]) or 1.0
    x, y = (table.values[columns[axis]] * metres for axis in "xy")
    columns = drop_constant_speeds(table, columns, x, y, notes)
    stated = stated_speed(table, columns)
    time, unit_s, speed_unit = infer_time(table, columns, options, source, x, y, stated, notes)
    columns = columns | {"time": time}
    steps = TableSteps.of(table.user, table.values[time] * unit_s, x, y)
    check_velocity_direction(table, columns, steps, notes)
    length_unit = _length_unit(table, columns, options, metres, source)
    heading_unit, zero, used = infer_heading(table, columns, options, source, steps, notes)
    if not used:
        columns = {role: name for role, name in columns.items() if role != "heading"}
    names = {name.strip().lower() for name in table.header}
    front = names >= LOOP or is_sumo_table(table.header)
    return TableSchema(
        columns=columns,
        time_unit_s=unit_s,
        metres=metres,
        length_unit_m=length_unit,
        speed_unit_mps=speed_unit,
        heading_unit_rad=heading_unit,
        heading_zero=zero,
        position=options.position or ("front" if front else "middle"),
        axes=options.axes or "x,y",
        notes=tuple(notes),
    )


def _length_unit(
    table: TableColumns, columns: Mapping[str, str], options: TableOptions, metres: float, source: str
) -> float:
    """Unit of the lengths of vehicles [m]; raises where lengths show that positions are in feet, too."""
    if "length" not in columns:
        return metres
    name = columns["length"]
    declared = declared_unit("length", name)
    lengths = table.values[name]
    lengths = lengths[np.isfinite(lengths) & (lengths > 0)]
    unit = declared or metres
    if options.metres is not None or declared_unit("x", columns["x"]) is not None or not len(lengths):
        return unit
    usual = float(np.median(lengths)) * unit
    low, high = _CAR_M
    if not low <= usual <= high and usual > 9.5 and low <= usual * 0.3048 <= high:
        raise TrajectoryError(
            f"{source}: {name} has a median of {usual:.3g}: in metres half of the road users are longer than a lorry, "
            f"in feet they are as long as cars; state the unit of lengths and positions in {source}.yaml, as `metres: "
            "0.3048` or `metres: 1`"
        )
    return unit


def _plain_roles(header: Sequence[str], source: str, options: TableOptions) -> dict[str, str]:
    """Columns of the roles that one name decides: all but the time."""
    absent = [name for name in options.columns.values() if name not in header]
    if absent:
        raise TrajectoryError(f"{source}: no column {', '.join(absent)}; its header is {','.join(header)}")
    found = dict(options.columns)
    for role in (
        "id",
        "x",
        "y",
        "z",
        "heading",
        "speed",
        "vx",
        "vy",
        "length",
        "width",
        "height",
        "type",
        "lane",
        "valid",
    ):
        names = named_columns(header, role)
        if role not in found and names:
            found[role] = names[0]
    missing = [role for role in NEEDED if role not in found]
    if "time" not in found and not named_columns(header, "time") and not named_columns(header, "frame"):
        missing = ["time", *missing]
    if missing:
        raise TrajectoryError(
            f"{source}: columns are missing; accepted names: {possible_names(missing)}; its header is "
            f"{','.join(header)}; "
            f"rename them, or state them in {source}.yaml, as `columns: {{{missing[0]}: NAME}}`"
        )
    return found

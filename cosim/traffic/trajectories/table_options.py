"""Options of a table of trajectories: `TABLE.yaml` next to it, such as `tracks.csv.yaml`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from cosim.drives.files import read_mapping
from cosim.traffic.trajectories.tracks import TrajectoryError
from sensors.pattern import first_problem

Heading = Literal[
    "degrees from east",
    "radians from east",
    "gradians from east",
    "degrees from north",
    "radians from north",
    "gradians from north",
    "unused",
]
AXES = ("x,y", "x,-y", "-x,y", "-x,-y", "y,x", "-y,x", "y,-x", "-y,-x")


class TableOptions(BaseModel):
    """All optional: what is not stated is inferred and checked."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    columns: dict[str, str] = Field(
        default_factory=dict,
        description="name of the column of a role: time, id, x, y, z, heading, speed, vx, vy, length, width, height, "
        "type, lane, valid",
    )
    time_unit_s: float | None = Field(default=None, gt=0, description="length of one unit of the time column [s]")
    frame_rate_hz: float | None = Field(default=None, gt=0, le=1000, description="frames a second of a frame counter")
    speed_unit_mps: float | None = Field(default=None, gt=0, description="one unit of the speeds [m/s], as 0.27778")
    metres: float | None = Field(default=None, gt=0, description="length of one unit of the positions [m], as 0.3048")
    heading: Heading | None = Field(
        default=None, description="unit and zero of the headings: from east counter-clockwise, from north clockwise"
    )
    axes: str | None = Field(default=None, description="which stored axes point east and north, as x,-y")
    position: Literal["middle", "front"] | None = Field(default=None, description="point of a vehicle that x, y give")

    @field_validator("axes")
    @classmethod
    def _are_axes(cls, value: str | None) -> str | None:
        if value is not None and value.replace(" ", "") not in AXES:
            raise ValueError(f"axes is one of {'; '.join(AXES)}")
        return None if value is None else value.replace(" ", "")


def read_table_options(table: Path) -> TableOptions:
    """Read the options file of a table; all defaults without one.

    Raises:
        TrajectoryError: an unknown key, or a value out of bounds.
        FormatError: the file is no YAML.
    """
    file = table.with_name(f"{table.name}.yaml")
    if not file.is_file():
        return TableOptions()
    try:
        return TableOptions.model_validate(read_mapping(file))
    except ValidationError as error:
        raise TrajectoryError(f"{file}: {first_problem(error)}") from None

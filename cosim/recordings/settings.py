"""Settings of a recording: `recording.yaml` in its folder, or options of the commands."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cosim.drives.files import read_mapping
from cosim.point_files import PointOptions
from cosim.recordings.scan import RecordingError, recording_errors
from sensors.pattern import first_problem

SETTINGS = "recording.yaml"
#: Names of checks that `--accept` may switch off, and what each finds.
Check = Literal["copies", "sensors", "lasers", "intensities", "travel", "order", "places", "poses"]
CHECKS: dict[Check, str] = {
    "copies": "scans that hold the same points as the one before",
    "sensors": "scans of several sensors",
    "lasers": "lasers that return nothing from a scan on, or at all though the pattern has them",
    "intensities": "scans without intensities among others with them",
    "travel": "a path along another axis than x",
    "order": "points that move against the path, as in scans in reverse order",
    "places": "neighbouring scans that do not show the same surroundings",
    "poses": "poses under which the points of neighbouring scans do not meet",
}


class RecordingMount(BaseModel):
    """Mount of the LiDAR above level ground, if it is not to be estimated from the ground in the scans."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    height_m: float = Field(gt=0, lt=30, description="of the optical centre above the ground [m]")
    pitch_deg: float = Field(default=0.0, gt=-90, lt=90, description="about y (left): positive is nose down [°]")
    roll_deg: float = Field(default=0.0, gt=-90, lt=90, description="about x (forward) [°]")


class RecordingSettings(BaseModel):
    """All optional: what is not said is found in the files."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    scans: str | None = Field(default=None, description="which files are scans, a pattern such as `raw_*.bin`")
    topic: str | None = Field(default=None, description="topic of a bag that holds the clouds")
    intensity_scale: float | None = Field(
        default=None, gt=0, description="stored value of full intensity, for example 255"
    )
    columns: str | None = Field(default=None, description="meaning of each column, as `x,y,z,intensity,_`")
    axes: str | None = Field(default=None, description="stored axes that are forward, left and up, as `x,-y,z`")
    flip_y: bool = Field(default=False, description="stored y points to the right")
    metres: float | None = Field(default=None, gt=0, description="length of one unit of x, y, z [m], as 0.001")
    sweep_s: float | None = Field(default=None, gt=0, le=10, description="duration of one revolution [s]")
    poses: str | None = Field(default=None, description="file of poses, relative to the folder: KITTI or TUM")
    accept: tuple[Check, ...] = Field(default=(), description="checks whose findings are notes, as `travel`")
    skip_damaged: bool = Field(default=False, description="leave scans out that cannot be read")
    segment_scans: int | None = Field(
        default=None, ge=20, le=1000, description="scans of a segment of a long recording; 150 by default"
    )
    mount: RecordingMount | None = Field(default=None, description="height and tilt of the sensor above level ground")

    @property
    def points(self) -> PointOptions:
        """Statements about the point files.

        Raises:
            RecordingError: a value that is no list of columns or axes.
        """
        with recording_errors():
            return PointOptions(self.columns, self.intensity_scale, self.axes, self.flip_y, self.metres)

    def with_options(self, **options: object) -> RecordingSettings:
        """The settings with what was given on the command line in their place; None gives nothing."""
        given = {name: value for name, value in options.items() if value is not None}
        return _validated({**self.model_dump(exclude_none=True), **given}, "options")


def read_settings(recording: Path) -> RecordingSettings:
    """The settings in a recording's folder; all found in the files where there are none.

    Raises:
        RecordingError: an unknown key or a value out of bounds.
        FormatError: the file is no YAML.
    """
    file = recording / SETTINGS
    return _validated(read_mapping(file), str(file)) if recording.is_dir() and file.is_file() else RecordingSettings()


def _validated(values: dict, origin: str) -> RecordingSettings:
    try:
        return RecordingSettings.model_validate(values)
    except ValidationError as error:
        raise RecordingError(f"{origin}: {first_problem(error)}") from None

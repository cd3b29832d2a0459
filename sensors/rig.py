"""Sensor rigs: which LiDARs and cameras there are, where they sit, and how cameras see."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from assets.documents import DocumentError, parse_yaml
from sensors.cameras.imaging import Imaging
from sensors.cameras.lens import Distortion
from sensors.errors import SensorError
from sensors.mount import Place
from sensors.pattern import first_problem

_FOLDER = files("sensors") / "rigs"
_NAME = re.compile(r"[a-z0-9][a-z0-9_]*", re.ASCII)
_ROTATION_TOLERANCE = 1e-3
KITTI = "kitti"
"""The default rig."""

KITTI_ROW = ("0", "1", "2", "3")
"""Names of KITTI's cameras, which share their axes and differ in P."""


def _plain(name: str) -> str:
    if not _NAME.fullmatch(name) or len(name) > 40:
        raise ValueError("a name has small letters, digits and _, 40 at most")
    return name


def _as_name(value: Any) -> Any:
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _as_rows(value: Any) -> Any:
    if not (isinstance(value, list | tuple) and all(isinstance(row, list | tuple) for row in value)):
        raise ValueError("give a matrix as rows of numbers, such as [[700, 0, 480], [0, 700, 300], [0, 0, 1]]")
    return value


Name = Annotated[str, AfterValidator(_plain)]
Rows = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(_as_rows)]


class RigLidar(BaseModel):
    """A LiDAR of a rig."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Name = Field(description="of its folder, and in the twin")
    sensor: str | None = Field(
        default=None, description="sensor file, or a pattern's name; none: the configuration's `sensor`"
    )
    mount: Place = Field(description="where it sits")


class RigCamera(BaseModel):
    """A camera of a rig; axes x right, y down, z forward."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Name = Field(description="of its folders: image_NAME, depth_NAME, …")
    kind: Literal["colour", "gray"] = Field(default="colour", description="what its images show")
    width_px: int = Field(ge=16, le=8192, description="columns of its images")
    height_px: int = Field(ge=16, le=8192, description="rows of its images")
    K: Rows | None = Field(default=None, description="3 × 3 camera matrix [px]; or give P")
    P: Rows | None = Field(
        default=None, description="3 × 4 projection, K and a fourth column −f·b [px, px·m]; or give K"
    )
    distortion: Distortion | None = Field(default=None, description="of its lens; none: a pinhole")
    imaging: Imaging = Field(default=Imaging(), description="its exposure, vignetting, blur and noise; none by default")
    mount: Place | None = Field(default=None, description="where it sits; or give from_lidar")
    from_lidar: Rows | None = Field(
        default=None, description="3 × 4, the camera's axes from the first LiDAR's, as calib/ has it; or give mount"
    )
    labels: bool = Field(default=False, description="whether labels are drawn in its images; the first such is KITTI's")

    @model_validator(mode="before")
    @classmethod
    def _named(cls, values: Any) -> Any:
        return {**values, "name": _as_name(values["name"])} if isinstance(values, dict) and "name" in values else values

    @model_validator(mode="after")
    def _consistent(self) -> RigCamera:
        if (self.K is None) == (self.P is None):
            raise ValueError("give either K, 3 × 3, or P, 3 × 4")
        if (self.mount is None) == (self.from_lidar is None):
            raise ValueError("give either mount or from_lidar")
        _demand_projection(self.projection)
        if self.from_lidar is not None:
            _demand_rigid(_array(self.from_lidar, (3, 4), "from_lidar"))
        if self.distortion is not None:
            if self.projection[:, 3].any():
                raise ValueError("P with a fourth column is that of a rectified camera; leave distortion out")
            self.distortion.check(self.projection[:, :3], self.width_px, self.height_px)
        return self

    @property
    def projection(self) -> np.ndarray:
        """(3, 4) from the camera's axes to pixels."""
        if self.P is not None:
            return _array(self.P, (3, 4), "P")
        assert self.K is not None  # one of both, as was checked
        return np.column_stack([_array(self.K, (3, 3), "K"), np.zeros(3)])


class Rig(BaseModel):
    """Sensors and their mounting positions on a vehicle."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    carrier: Literal["vehicle", "mast"] = Field(
        default="vehicle", description="a vehicle in the traffic, or a mast next to the road"
    )
    lidars: tuple[RigLidar, ...] = Field(min_length=1, max_length=16, description="the first one's scans are velodyne/")
    cameras: tuple[RigCamera, ...] = Field(min_length=1, max_length=32, description="at least one, to draw labels in")
    imu_to_lidar: Rows | None = Field(
        default=None, description="3 × 4, the first LiDAR's axes from the inertial unit's; none: it is at the origin"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Rig:
        for what, names in (("LiDARs", [o.name for o in self.lidars]), ("cameras", [o.name for o in self.cameras])):
            double = sorted({name for name in names if names.count(name) > 1})
            if double:
                raise ValueError(f"two {what} are called {double[0]!r}; give each a name of its own")
        if self.carrier == "vehicle":
            for sensor in (*self.lidars, *self.cameras):
                _demand_outside(sensor)
        if self.imu_to_lidar is not None:
            _demand_rigid(_array(self.imu_to_lidar, (3, 4), "imu_to_lidar"))
        row = [camera for camera in self.cameras if camera.name in KITTI_ROW]
        if len({(camera.mount, camera.from_lidar) for camera in row}) > 1:
            raise ValueError("cameras 0 to 3 share their axes, as KITTI's; give all the same place, or other names")
        if row and (len(row) < len(self.cameras) or any(camera.distortion for camera in row)):
            raise ValueError("cameras 0 to 3 are KITTI's rectified row; give cameras other names, or only these")
        return self

    @property
    def reference(self) -> RigCamera:
        """The camera in whose axes labels are."""
        return next((camera for camera in self.cameras if camera.labels), self.cameras[0])

    @property
    def kitti_row(self) -> bool:
        """Whether its cameras are KITTI's row, by their names."""
        return self.cameras[0].name in KITTI_ROW

    @property
    def default_images(self) -> tuple[str, ...]:
        """Folders of images that are written by default."""
        if self.kitti_row:
            names = {camera.name for camera in self.cameras}
            return tuple(part for part in ("image_0", "image_2", "depth_0") if part.rpartition("_")[2] in names)
        return (*(f"image_{camera.name}" for camera in self.cameras), f"depth_{self.reference.name}")


def rig_names() -> list[str]:
    """Names of the built-in rigs."""
    return sorted(item.name.removesuffix(".yaml") for item in _FOLDER.iterdir() if item.name.endswith(".yaml"))


def load_rig(name_or_path: str | Path) -> Rig:
    """A built-in rig by name, or one from its file; paths of sensors in it are relative to the file.

    Raises:
        SensorError: no such rig, or the file breaks the format.
    """
    text = str(name_or_path)
    built_in = text in rig_names()
    source = _FOLDER / f"{text}.yaml" if built_in else Path(text)
    if not source.is_file():
        raise SensorError(f"rig {text!r} does not exist; choose one of {', '.join(rig_names())} or give a file's path")
    try:
        values = parse_yaml(source.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, DocumentError) as error:
        raise SensorError(f"rig {text} cannot be read: {' '.join(str(error).split())}") from error
    try:
        rig = Rig.model_validate(values)
    except ValidationError as error:
        raise SensorError(f"rig {text}: {first_problem(error)}") from error
    return rig if built_in else _relative_to_file(rig, Path(text).parent)


def _relative_to_file(rig: Rig, folder: Path) -> Rig:
    """The rig with paths of sensor files relative to its own file."""
    found = [
        one.model_copy(update={"sensor": str(folder / one.sensor)})
        if one.sensor is not None and (folder / one.sensor).is_file()
        else one
        for one in rig.lidars
    ]
    return rig.model_copy(update={"lidars": tuple(found)})


def _demand_outside(sensor: RigLidar | RigCamera) -> None:
    if sensor.mount is None:
        return
    try:
        sensor.mount.demand_outside()
    except ValueError as error:
        raise ValueError(f"the mount of {sensor.name!r}: {error}") from None


def _array(rows: Rows, shape: tuple[int, int], what: str) -> np.ndarray:
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        raise ValueError(f"{what} has {len(rows)} rows; give {shape[0]} rows of {shape[1]} numbers")
    array = np.array(rows, np.float64)
    if not np.isfinite(array).all():
        raise ValueError(f"{what} holds NaN or infinity; give finite numbers")
    return array


def _demand_projection(matrix: np.ndarray) -> None:
    """Raise ValueError for what is no camera matrix."""
    upright = matrix[0, 0] > 0 and matrix[1, 1] > 0 and matrix[1, 0] == 0 and matrix[2, :3].tolist() == [0, 0, 1]
    if not upright:
        raise ValueError(
            f"{np.round(matrix[:, :3], 3).tolist()} is no camera matrix; give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] "
            "with fx and fy above 0"
        )


def _demand_rigid(matrix: np.ndarray) -> None:
    rotation = matrix[:, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        raise ValueError("its first three columns are no rotation; give rows of [R | t] with R·Rᵀ = 1")

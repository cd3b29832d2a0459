"""Configuration of a run."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from assets.documents import DocumentError, parse_yaml
from assets.world.environment import EnvironmentConfig
from cosim.capture.collection import Collection
from cosim.capture.mounts import Mounts
from cosim.capture.navigation import Navigation
from cosim.capture.products import check_products
from cosim.capture.rig_jitter import RigJitter
from cosim.errors import CosimError
from cosim.labels.annotators import Annotators
from cosim.scene.world_file import WorldFile
from cosim.traffic.behaviour.config import BehaviourConfig
from sensors.pattern import first_problem
from sensors.rig import KITTI, Rig, load_rig, rig_names
from sumo_nets import TOWNS, DemandConfig
from sumo_nets.dispatch import Algorithm


class ConfigError(CosimError):
    """A configuration breaks its rules."""


_HEAD_BYTES = 4096


class MastPosition(BaseModel):
    """Position and heading of the mast of a roadside rig, in SUMO's axes (x east, y north)."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    x_m: float = Field(description="east [m]")
    y_m: float = Field(description="north [m]")
    heading_deg: float = Field(
        default=0.0, ge=-360, le=360, description="direction of its x axis, counter-clockwise from east [°]"
    )


class LabelConfig(BaseModel):
    """Who draws the 3D boxes of the labels."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    annotator: str = Field(
        default="exact",
        description="`exact`, `kitti` (boxes with the errors of KITTI's annotators), or the path of a file with "
        "label effects",
    )


class RunConfig(BaseModel):
    """All settings that determine the content of a drive. The same configuration gives the same bytes."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    town: str | tuple[str, ...] = Field(
        default="town01", description="built-in towns (`town01`, a list, or `all`), or the path of a .sumocfg file"
    )
    frames: int = Field(default=100, ge=1, le=1_000_000, description="frames to record")
    seed: int = Field(default=0, ge=0, lt=2**31, description="seed of traffic, world, models and paints")
    sensor: str = Field(
        default="hdl64e", description="path of a sensor file, or the name of a beam pattern (a sensor without effects)"
    )
    rig: str | Rig = Field(
        default=KITTI,
        description="LiDARs, cameras and their mounts: name of a built-in rig, path of a rig file, or the rig itself",
    )
    frames_per_episode: int = Field(default=25, ge=1, le=10_000, description="frames recorded in one SUMO simulation")
    warm_up_s: float = Field(default=60.0, ge=0, le=3600, description="simulated time before the first frame [s]")
    step_s: float = Field(default=0.1, gt=0, le=1, description="SUMO's step length [s]")
    collection: Collection = Field(default=Collection(), description="when a frame is recorded")
    population: DemandConfig = Field(
        default=DemandConfig(), description="numbers of vehicles and people in built-in towns"
    )
    environment: EnvironmentConfig = Field(
        default=EnvironmentConfig(), description="buildings, plants and street furniture of built-in and own towns"
    )
    world: WorldFile | None = Field(
        default=None,
        description="a glTF file with the static world of the town, used instead of a generated world; or `file` and "
        "`materials`",
    )
    episodes_per_world: int = Field(default=4, ge=1, le=10_000, description="episodes per random world of a town")
    rig_jitter: RigJitter = Field(default=RigJitter(), description="random rotation of the sensor rig in each frame")
    mounts: Mounts = Field(default=Mounts(), description="mounts of LiDAR and cameras of the rig kitti on the vehicle")
    mast: MastPosition | None = Field(
        default=None, description="position of the mast of a roadside rig; none: a random position near traffic"
    )
    navigation: Navigation = Field(
        default=Navigation(), description="errors of the GPS and of the inertial measurement unit"
    )
    label_range_m: float = Field(
        default=80.0, gt=0, le=500, description="objects farther away than this become DontCare [m]"
    )
    min_label_pixels: int = Field(
        default=20, ge=1, description="objects with fewer visible pixels than this get no label"
    )
    min_label_points: int = Field(default=6, ge=0, description="objects hit by fewer beams than this become DontCare")
    annotators: Annotators = Field(
        default=Annotators(), description="objects that annotators leave to DontCare regions"
    )
    labels: LabelConfig = Field(default=LabelConfig(), description="who draws the 3D boxes of the labels")
    external_vehicles: Path | None = Field(
        default=None,
        description="folder of vehicle meshes with a vehicles.yaml, used in addition to the built-in models",
    )
    trajectories: Path | None = Field(
        default=None,
        description="file of recorded trajectories to replay: FCD output, CommonRoad, OpenSCENARIO or a table; none: "
        "SUMO simulates the traffic",
    )
    taxi_dispatch: Algorithm | None = Field(
        default=None,
        description="SUMO's dispatcher of taxis and vehicles on demand, for a scenario whose dispatcher is another "
        "program; none: as the scenario defines it",
    )
    ego: str | None = Field(
        default=None,
        description="id of the vehicle in the trajectories that carries the sensors; none: chosen randomly",
    )
    behaviour: BehaviourConfig = Field(
        default=BehaviourConfig(), description="driver behaviour: settings, or the name of a preset"
    )
    store_hits: bool = Field(default=True, description="keep hits/, which `cosim variants` needs")
    images: tuple[str, ...] = Field(
        default=("image_0", "image_2", "depth_0"),
        description="folders of images to write: image_, depth_, semantic_ or instance_ followed by the name of a "
        "camera; KITTI's cameras are called 0 to 3",
    )
    backend: Literal["osmesa", "egl"] = Field(default="osmesa", description="OpenGL backend that renders the images")

    @field_validator("rig", mode="before")
    @classmethod
    def _read_rig(cls, rig: Any) -> Any:
        return load_rig(rig) if isinstance(rig, str) and rig not in rig_names() else rig

    @model_validator(mode="before")
    @classmethod
    def _all_its_images(cls, values: Any) -> Any:
        """Replace the default images, which are those of KITTI, by the images of the given rig."""
        if not isinstance(values, dict) or "images" in values or values.get("rig", KITTI) == KITTI:
            return values
        rig = values["rig"]
        if isinstance(rig, dict):
            rig = Rig.model_validate(rig)
        elif isinstance(rig, str):
            rig = load_rig(rig)
        return {**values, "rig": values["rig"], "images": rig.default_images} if isinstance(rig, Rig) else values

    @model_validator(mode="before")
    @classmethod
    def _own_streets(cls, values: Any) -> Any:
        """Use a CommonRoad scenario also as the town, because it contains its road network."""
        if not isinstance(values, dict) or "town" in values or not values.get("trajectories"):
            return values
        path = Path(str(values["trajectories"]))
        try:
            head = path.open("rb").read(_HEAD_BYTES)
        except OSError:
            return values  # the reader of the trajectories reports the error
        return {**values, "town": str(path)} if b"<commonRoad" in head else values

    @model_validator(mode="after")
    def _has_trajectories(self) -> RunConfig:
        if self.ego is not None and self.trajectories is None:
            raise ValueError("ego names a vehicle of trajectories; give `trajectories`, or leave ego out")
        if self.world is not None and len(self.towns) > 1:
            raise ValueError("a world file belongs to one town; set `town` to that town")
        if self.trajectories is not None and len(self.towns) > 1:
            raise ValueError("trajectories belong to one town; set `town` to that town")
        if self.taxi_dispatch is not None and set(self.towns) & set(TOWNS):
            raise ValueError(
                "taxi_dispatch is for a scenario of your own; give its .sumocfg as `town`, or leave it out"
            )
        if self.ego is not None and self.rig_used.carrier == "mast":
            raise ValueError("a mast carries the sensors; leave ego out, or give a rig on a vehicle")
        return self

    @model_validator(mode="after")
    def _fits_its_rig(self) -> RunConfig:
        rig = self.rig_used
        check_products(self.images, [camera.name for camera in rig.cameras])
        if self.mounts != Mounts() and self.rig != KITTI:
            raise ValueError("mounts applies only to the rig kitti; write the mounts into the rig's file")
        if self.mast is not None and rig.carrier != "mast":
            raise ValueError("mast applies only to roadside rigs; leave it out, or give a rig with carrier: mast")
        if self.sensor != RunConfig.model_fields["sensor"].default and all(lidar.sensor for lidar in rig.lidars):
            raise ValueError(
                f"sensor {self.sensor} would not be used: every LiDAR of the rig names its own sensor; change it there"
            )
        return self

    @property
    def rig_used(self) -> Rig:
        """The rig, loaded if it is given by name."""
        return self.rig if isinstance(self.rig, Rig) else _built_in(self.rig)

    @property
    def towns(self) -> tuple[str, ...]:
        """Names or paths of the towns; episodes alternate between them."""
        if self.town == "all":
            return TOWNS
        return (self.town,) if isinstance(self.town, str) else self.town


@cache
def _built_in(name: str) -> Rig:
    return load_rig(name)


def _resolve_town(folder: Path, town: object) -> object:
    """Make `.sumocfg` paths that are relative to the configuration's folder absolute; leave other towns unchanged."""
    if isinstance(town, list):
        return [_resolve_town(folder, part) for part in town]
    if not isinstance(town, str) or not town.endswith(".sumocfg"):
        return town
    relative = (folder / town).resolve()
    return str(relative) if relative.is_file() and relative != Path(town).resolve() else town


def load_config(path: Path | None, **overrides: object) -> RunConfig:
    """Read a configuration from a YAML file; `overrides` replace its values (None: keep the value of the file).

    Raises:
        ConfigError: the file is unreadable or not YAML, a key is unknown, or a value is out of bounds.
    """
    values: dict[str, object] = {}
    if path is not None:
        try:
            loaded = parse_yaml(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise ConfigError(f"cannot read {path}: {error.strerror}; give the path of a YAML file") from error
        except (DocumentError, UnicodeDecodeError) as error:
            raise ConfigError(f"{path} is not YAML: {' '.join(str(error).split())}") from error
        if loaded is not None and not isinstance(loaded, dict):
            raise ConfigError(
                f"{path} contains {type(loaded).__name__}, not keys and values; write, for example, `town: town01`"
            )
        values.update(loaded or {})
        if "town" in values:
            values["town"] = _resolve_town(path.parent, values["town"])
    values.update({key: value for key, value in overrides.items() if value is not None})
    try:
        return RunConfig.model_validate(values)
    except ValidationError as error:
        keys = ", ".join(RunConfig.model_fields)
        where = f"{path}: " if path else ""
        is_unknown_key = error.errors()[0]["type"] == "extra_forbidden"
        hint = f"; known keys are {keys}" if is_unknown_key else ""
        raise ConfigError(f"{where}{first_problem(error)}{hint}") from error

"""What a run is asked to do."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from assets.documents import DocumentError, parse_yaml
from assets.world import EnvironmentConfig
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


class MastPlace(BaseModel):
    """Where the mast of a roadside rig stands; axes of the town, as SUMO has them."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    x_m: float = Field(description="east [m]")
    y_m: float = Field(description="north [m]")
    heading_deg: float = Field(default=0.0, ge=-360, le=360, description="of its x axis, left of east [°]")


class RunConfig(BaseModel):
    """Everything that decides the content of a drive. The same configuration gives the same bytes."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    town: str | tuple[str, ...] = Field(
        default="town01", description="built-in towns (`town01`, a list, or `all`), or the path of a .sumocfg file"
    )
    frames: int = Field(default=100, ge=1, le=1_000_000, description="frames to record")
    seed: int = Field(default=0, ge=0, lt=2**31, description="seed of traffic, world, models and paints")
    sensor: str = Field(default="hdl64e", description="a sensor file's path, or the name of a beam pattern used bare")
    rig: str | Rig = Field(
        default=KITTI, description="which LiDARs and cameras, and where: a built-in rig, a file's path, or the rig"
    )
    frames_per_episode: int = Field(default=25, ge=1, le=10_000, description="frames recorded in one SUMO simulation")
    warm_up_s: float = Field(default=60.0, ge=0, le=3600, description="simulated time before the first frame [s]")
    step_s: float = Field(default=0.1, gt=0, le=1, description="SUMO's step length [s]")
    collection: Collection = Field(default=Collection(), description="which instants become frames")
    population: DemandConfig = Field(default=DemandConfig(), description="who is about in built-in towns")
    environment: EnvironmentConfig = Field(
        default=EnvironmentConfig(), description="how built-in and own towns are furnished"
    )
    world: WorldFile | None = Field(
        default=None,
        description="a glTF file with the static world of the town, in place of what is built; or `file` "
        "and `materials`",
    )
    episodes_per_world: int = Field(default=4, ge=1, le=10_000, description="episodes in one random world of a town")
    rig_jitter: RigJitter = Field(default=RigJitter(), description="random rotation of the sensor rig, frame by frame")
    mounts: Mounts = Field(default=Mounts(), description="where LiDAR and cameras of the rig kitti sit on the vehicle")
    mast: MastPlace | None = Field(
        default=None, description="where the mast of a roadside rig stands; none: where traffic passes, by chance"
    )
    navigation: Navigation = Field(default=Navigation(), description="errors of GPS and inertial unit")
    label_range_m: float = Field(default=80.0, gt=0, le=500, description="beyond this, objects become DontCare [m]")
    min_label_pixels: int = Field(default=20, ge=1, description="fewer visible pixels than this give no label")
    min_label_points: int = Field(
        default=6, ge=0, description="objects that return fewer beams than this become DontCare"
    )
    annotators: Annotators = Field(default=Annotators(), description="whom annotators leave to DontCare regions")
    external_vehicles: Path | None = Field(
        default=None, description="folder of vehicle meshes with a vehicles.yaml, drawn beside the built-in models"
    )
    trajectories: Path | None = Field(
        default=None,
        description="who drives where, from a file: FCD output, CommonRoad, OpenSCENARIO or a table; none: SUMO's",
    )
    taxi_dispatch: Algorithm | None = Field(
        default=None,
        description="SUMO's own dispatcher of taxis and vehicles on demand, for a scenario whose dispatcher is another "
        "program; none: as the scenario has it",
    )
    ego: str | None = Field(default=None, description="id of the vehicle of the trajectories that carries the sensors")
    behaviour: BehaviourConfig = Field(default=BehaviourConfig(), description="how drivers behave; or a preset's name")
    store_hits: bool = Field(default=True, description="keep hits/, from which sensor variants can be made again")
    images: tuple[str, ...] = Field(
        default=("image_0", "image_2", "depth_0"),
        description="folders of images to write: image_, depth_, semantic_ or instance_ with a camera's name; KITTI's "
        "are called 0 to 3",
    )
    backend: Literal["osmesa", "egl"] = Field(default="osmesa", description="how images are rendered")

    @field_validator("rig", mode="before")
    @classmethod
    def _read_rig(cls, rig: Any) -> Any:
        return load_rig(rig) if isinstance(rig, str) and rig not in rig_names() else rig

    @model_validator(mode="before")
    @classmethod
    def _all_its_images(cls, values: Any) -> Any:
        """Rigs of their own write what their own cameras see."""
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
        """CommonRoad scenarios hold their streets."""
        if not isinstance(values, dict) or "town" in values or not values.get("trajectories"):
            return values
        path = Path(str(values["trajectories"]))
        try:
            begins = path.open("rb").read(_HEAD_BYTES)
        except OSError:
            return values  # whoever reads it says so
        return {**values, "town": str(path)} if b"<commonRoad" in begins else values

    @model_validator(mode="after")
    def _has_trajectories(self) -> RunConfig:
        if self.ego is not None and self.trajectories is None:
            raise ValueError("ego names a vehicle of trajectories; give `trajectories`, or leave ego out")
        if self.world is not None and len(self.towns) > 1:
            raise ValueError("world is that of one town; name it")
        if self.trajectories is not None and len(self.towns) > 1:
            raise ValueError("trajectories belong to one town; name it")
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
            raise ValueError("mounts moves the sensors of the rig kitti; write the mounts into the rig's file")
        if self.mast is not None and rig.carrier != "mast":
            raise ValueError("mast is the place of a roadside rig; leave it out, or give a rig with carrier: mast")
        if self.sensor != RunConfig.model_fields["sensor"].default and all(one.sensor for one in rig.lidars):
            raise ValueError(f"sensor {self.sensor} is for nobody: every LiDAR of the rig has its own; name it there")
        return self

    @property
    def rig_used(self) -> Rig:
        """The rig that is meant."""
        return self.rig if isinstance(self.rig, Rig) else _built_in(self.rig)

    @property
    def towns(self) -> tuple[str, ...]:
        """The towns that take turns."""
        if self.town == "all":
            return TOWNS
        return (self.town,) if isinstance(self.town, str) else self.town


@cache
def _built_in(name: str) -> Rig:
    return load_rig(name)


def _found_from(folder: Path, town: object) -> object:
    """Towns whose `.sumocfg` is given relative to the configuration's folder, as absolute paths; others unchanged."""
    if isinstance(town, list):
        return [_found_from(folder, part) for part in town]
    if not isinstance(town, str) or not town.endswith(".sumocfg"):
        return town
    beside = (folder / town).resolve()
    return str(beside) if beside.is_file() and beside != Path(town).resolve() else town


def load_config(path: Path | None, **overrides: object) -> RunConfig:
    """A configuration from a YAML file, with values of the command line on top (None: not given).

    Raises:
        ConfigError: unreadable, not YAML, an unknown key or a value out of bounds.
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
            raise ConfigError(f"{path} holds {type(loaded).__name__}, not keys and values; write `town: town01`")
        values.update(loaded or {})
        if "town" in values:
            values["town"] = _found_from(path.parent, values["town"])
    values.update({key: value for key, value in overrides.items() if value is not None})
    try:
        return RunConfig.model_validate(values)
    except ValidationError as error:
        known = ", ".join(RunConfig.model_fields)
        where = f"{path}: " if path else ""
        unknown = error.errors()[0]["type"] == "extra_forbidden"
        hint = f"; known keys are {known}" if unknown else ""
        raise ConfigError(f"{where}{first_problem(error)}{hint}") from error

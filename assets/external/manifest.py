"""`vehicles.yaml`: meshes of a folder, and axes and units of each file."""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Annotated, Literal

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError, model_validator

from assets.documents import DocumentError, parse_yaml
from assets.errors import AssetError
from assets.materials import MATERIALS
from assets.models.catalogue import CATALOGUE, Kind

MANIFEST = "vehicles.yaml"
SUFFIXES = (".glb", ".gltf", ".obj", ".dae")
_LARGEST_BYTES = 1 << 20
_SILENT = {".obj": ("up", "forward"), ".dae": ("forward",)}  # axes that a format does not define

Axis = Literal["x", "+x", "-x", "y", "+y", "-y", "z", "+z", "-z"]
_Metres = Annotated[float, Field(gt=0, le=50, allow_inf_nan=False)]


class VehicleEntry(BaseModel):
    """One mesh of the folder.

    Dimensions are measured from the mesh. Those given here replace the measured ones; if only some are given,
    the rest follow in proportion.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)

    file: str = Field(description="path of the mesh, relative to the manifest: .glb, .gltf, .obj or .dae")
    kind: Kind = Field(
        validation_alias=AliasChoices("kind", "class"),
        description="kind of road user: car, van, truck, bus, tram, motorcycle, cyclist, pedestrian or person_sitting",
    )
    name: str = Field("", pattern=r"^([A-Za-z0-9_][A-Za-z0-9_-]{0,63})?$", description="default: the file's stem")
    length_m: _Metres | None = Field(None, description="full length of the box [m]")
    width_m: _Metres | None = Field(None, description="full width of the box [m]")
    height_m: _Metres | None = Field(None, description="full height of the box [m]")
    forward: Axis | None = Field(None, description="axis of the file the vehicle drives along; glTF: +z")
    up: Axis | None = Field(None, description="axis of the file that points up; glTF: +y, DAE: as it says")
    unit_m: float | None = Field(
        None, gt=0, le=1000, allow_inf_nan=False, description="metres in a unit of the file; glTF and OBJ: 1"
    )
    materials: dict[str, str] = Field(
        default_factory=dict, description="material names of the file → names of the material table"
    )

    @model_validator(mode="after")
    def _check(self) -> VehicleEntry:
        path = PurePosixPath(self.file.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts or ":" in self.file:
            raise ValueError(f"file {self.file!r} leaves the folder; give a path inside it")
        if path.suffix.lower() not in SUFFIXES:
            raise ValueError(f"file {self.file!r} is not one of {', '.join(SUFFIXES)}; export it as .glb")
        for key in _SILENT.get(path.suffix.lower(), ()):
            if getattr(self, key) is None:
                raise ValueError(f"{self.file}: {path.suffix} files do not define {key}; state it, as {key}: z")
        if self.forward and self.up and self.forward[-1] == self.up[-1]:
            raise ValueError(f"{self.file}: forward {self.forward} and up {self.up} are the same axis; give two axes")
        for name in self.materials.values():
            if name not in MATERIALS:
                raise ValueError(f"{self.file}: material {name!r} is not in the table (assets/materials.py)")
        return self.model_copy(update={"name": _plain(path.stem)}) if not self.name else self


_ENTRIES = TypeAdapter(list[VehicleEntry])


def read_manifest(folder: Path) -> tuple[VehicleEntry, ...]:
    """The entries of `folder/vehicles.yaml`, names unique and none of the catalogue's.

    Raises:
        AssetError: no folder or manifest, not a YAML list, an unknown key, a value out of bounds, a name twice.
    """
    file = folder / MANIFEST
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise AssetError(f"{file}: larger than {_LARGEST_BYTES >> 20} MiB; is it a manifest?")
        content = parse_yaml(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise AssetError(f"{file}: {error.strerror}; external vehicles need a folder with {MANIFEST}") from None
    except (DocumentError, UnicodeDecodeError) as error:
        raise AssetError(f"{file}: not readable as YAML ({' '.join(str(error).split())})") from None
    if not isinstance(content, list) or not content:
        raise AssetError(f"{file}: holds no list; write one entry a mesh, as `- {{file: golf.glb, kind: car}}`")
    try:
        entries = _ENTRIES.validate_python(content)
    except ValidationError as error:
        raise AssetError(f"{file}: {_fault(error)}") from None
    seen: set[str] = set()
    for entry in entries:
        if entry.name in seen or entry.name in CATALOGUE:
            whose = "another entry" if entry.name in seen else "a built-in model"
            raise AssetError(f"{file}: {whose} is also called {entry.name!r}; give {entry.file} another name")
        seen.add(entry.name)
    return tuple(entries)


def _fault(error: ValidationError) -> str:
    fault = error.errors()[0]
    row, *location = fault["loc"]
    where = " → ".join([f"entry {int(row) + 1}", *map(str, location)])
    if fault["type"] == "extra_forbidden":
        return f"{where}: unknown key; known are {', '.join(VehicleEntry.model_fields)}"
    message = fault["msg"].removeprefix("Value error, ")
    given = "" if fault["type"] in ("value_error", "missing") else f" (got {str(fault['input'])[:60]!r})"
    return f"{where}: {message}{given}"


def _plain(stem: str) -> str:
    plain = "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in stem)
    return plain[:64] or "vehicle"

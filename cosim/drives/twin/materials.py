"""`twin/materials.yaml`: what every material name of the twin answers and how it looks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from assets.materials import MATERIALS
from cosim.drives.files import read_mapping
from cosim.errors import FormatError

_Share = Annotated[float, Field(ge=0, le=1)]


class MaterialEntry(BaseModel):
    """One material of the file."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)

    reflectance: _Share = Field(description="diffuse reflectance at 905 nm, 0–1")
    albedo: _Share = Field(description="visible albedo, 0–1")
    kind: Literal["opaque", "glass"] = Field("opaque", alias="class", description="glass lets beams through")
    retro: bool = Field(False, description="retro-reflective")
    metal: bool = Field(False, description="bare metal, able to mirror a beam")
    road: bool = Field(False, description="part of the carriageway, wetted by rain")
    paint: bool = Field(False, description="takes the instance's paint as its reflectance")


_FILE = TypeAdapter(dict[str, MaterialEntry])


def format_materials(names: Iterable[str], reflectance: Mapping[str, float] | None = None) -> str:
    """The text of a file with the table's entries for `names`, sorted; some with a `reflectance` of their own.

    Raises:
        FormatError: a name is not in the material table.
    """
    entries = {}
    for name in sorted(set(names)):
        if name not in MATERIALS:
            raise FormatError(f"material {name!r} is not in the table; add it to assets/materials.py")
        row = MATERIALS[name]
        switches = {"retro": row.retro, "metal": row.metal, "road": row.road, "paint": row.paint}
        own = (reflectance or {}).get(name, row.reflectance)
        entry = {"reflectance": own, "albedo": row.albedo, "class": row.kind, **switches}
        entries[name] = MaterialEntry.model_validate(entry).model_dump(by_alias=True)
    return yaml.safe_dump(entries, sort_keys=False, default_flow_style=None, width=200)


def write_materials(path: str | Path, names: Iterable[str]) -> None:
    """Write the entries of `names` (all names in use, glTF models included); see `format_materials`."""
    Path(path).write_text(format_materials(names), encoding="utf-8", newline="\n")


def read_materials(path: str | Path) -> Mapping[str, MaterialEntry]:
    """The entries of a file by material name.

    Raises:
        FormatError: not YAML, an unknown or missing key, or a value out of bounds; the first fault is named.
    """
    try:
        return _FILE.validate_python(read_mapping(path))
    except ValidationError as error:
        fault = error.errors()[0]
        location = " → ".join(str(part) for part in fault["loc"]) or "the file"
        raise FormatError(f"{path}: {location}: {fault['msg']} (found {fault['input']!r})") from None

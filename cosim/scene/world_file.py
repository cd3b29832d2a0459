"""User-supplied static world: a glTF mesh with named materials."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from assets import MATERIALS
from assets.external.material_words import split_words
from assets.mesh import Mesh
from assets.streets import Streets
from cosim.drives.twin.glb import material_names, read_glb
from cosim.errors import CosimError
from cosim.scene.ground import Ground

_MAX_FACES = 20_000_000
_MIN_COVERED_SHARE = 0.5
# Material of the catalogue → words in a material's name; the last known word of a name decides.
_WORDS = {
    "asphalt": "asphalt road roads street streets carriageway tarmac lane lanes",
    "paving": "sidewalk sidewalks pavement pavements paving footpath footway plaza",
    "kerb": "kerb kerbs curb curbs",
    "cobble": "cobble cobbles cobblestone",
    "gravel": "gravel ballast",
    "road_marking": "marking markings line lines crosswalk zebra",
    "grass": "grass lawn meadow terrain ground land field",
    "soil": "soil dirt earth sand mud",
    "foliage": "foliage leaf leaves tree trees vegetation bush bushes plant plants canopy shrub",
    "hedge": "hedge hedges",
    "bark": "bark trunk trunks branch branches",
    "brick": "brick bricks",
    "concrete": "concrete cement bridge barrier",
    "stone": "stone stones rock rocks",
    "plaster_grey": "wall walls building buildings house houses facade plaster stucco",
    "roof_tile": "roof roofs tile tiles",
    "window_glass": "window windows glass pane panes",
    "window_frame": "frame frames",
    "door": "door doors",
    "wood": "wood wooden timber fence fences bench",
    "steel_galvanised": "steel metal pole poles post posts mast guardrail railing lamppost",
    "sign_face": "sign signs",
    "signal_housing": "signal trafficlight",
}
_MATERIAL_OF = {word: name for name, words in _WORDS.items() for word in words.split()}


class WorldError(CosimError):
    """A world file cannot be used."""


class WorldFile(BaseModel):
    """Path of a static world, and the mapping of its materials."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    file: Path = Field(description="path of a .glb or .gltf file: y up, in metres, in the axes of the road network")
    materials: dict[str, str] = Field(default={}, description="material names in the file → materials of the catalogue")

    @model_validator(mode="before")
    @classmethod
    def _accept_path(cls, values: Any) -> Any:
        return {"file": values} if isinstance(values, str | Path) else values

    @field_validator("materials")
    @classmethod
    def _check_materials(cls, materials: dict[str, str]) -> dict[str, str]:
        unknown = sorted(set(materials.values()) - MATERIALS.keys())
        if unknown:
            raise ValueError(f"{unknown[0]!r} is not a material; give one of {', '.join(sorted(MATERIALS))}")
        return materials

    def read(self, streets: Streets) -> Mesh:
        """Read the mesh and check that it covers the streets.

        Raises:
            WorldError: a material has no name or an unknown name, the mesh has no face or too many, or it does not
                cover the streets.
            FormatError: the file cannot be read.
        """
        mesh = read_glb(self.file, self._mapping())
        if not len(mesh.faces):
            raise WorldError(f"world {self.file}: contains no faces; export its surfaces")
        if len(mesh.faces) > _MAX_FACES:
            raise WorldError(f"world {self.file}: more than {_MAX_FACES:,} triangles; simplify it")
        points = np.concatenate([lane.centre for lane in streets.lanes if lane.use == "drive"])
        low, high = mesh.bounds.astype(np.float64)
        share = float(Ground(mesh).lies_under(points).mean())
        if share < _MIN_COVERED_SHARE:
            raise WorldError(
                f"world {self.file}: only {share:.0%} of the streets have a surface in it; it extends from "
                f"({low[0]:.0f}, {low[1]:.0f}, {low[2]:.0f}) to ({high[0]:.0f}, {high[1]:.0f}, {high[2]:.0f}) m east, "
                "north and up: export it in the network's axes, y up, in metres"
            )
        return mesh

    def _mapping(self) -> dict[str, str]:
        """Material of the catalogue for each material name in the file."""
        names = material_names(self.file)
        if not any(names):
            raise WorldError(
                f"world {self.file}: its faces have no named materials; name them, such as asphalt or brick"
            )
        mapping = {name: self.materials.get(name) or guess_material(name) for name in names}
        unknown = sorted(name for name, material in mapping.items() if material is None)
        if unknown:
            raise WorldError(
                f"world {self.file}: materials {', '.join(map(repr, unknown[:6]))} are unknown; map them to materials "
                f"of the catalogue, world: {{file: {self.file}, materials: {{{unknown[0] or 'NAME'}: concrete}}}}"
            )
        return {name: material for name, material in mapping.items() if material is not None}


def guess_material(name: str) -> str | None:
    """Guess the material of the catalogue from the words of a name; None if no word is known."""
    if name in MATERIALS:
        return name
    known = [_MATERIAL_OF[word] for word in split_words(name) if word in _MATERIAL_OF]
    return known[-1] if known else None

"""A static world of a user's own, as a glTF mesh with named materials."""

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

_MOST_FACES = 20_000_000
_FEWEST_SHARE = 0.5
# Words of a name → material of the table; of the words that are known, the last decides.
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
    """A world's file cannot be used."""


class WorldFile(BaseModel):
    """Where a static world is, and what its materials are."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    file: Path = Field(description="a .glb or .gltf file, y up, metres, in the network's axes")
    materials: dict[str, str] = Field(default={}, description="names in the file → materials of the catalogue")

    @model_validator(mode="before")
    @classmethod
    def _file_alone(cls, values: Any) -> Any:
        return {"file": values} if isinstance(values, str | Path) else values

    @field_validator("materials")
    @classmethod
    def _known(cls, materials: dict[str, str]) -> dict[str, str]:
        unknown = sorted(set(materials.values()) - MATERIALS.keys())
        if unknown:
            raise ValueError(f"{unknown[0]!r} is no material; give one of {', '.join(sorted(MATERIALS))}")
        return materials

    def read(self, streets: Streets) -> Mesh:
        """The world's triangles, checked to lie under the streets.

        Raises:
            WorldError: materials are not named, or mean nothing; no face; too many; or it lies elsewhere.
            FormatError: the file cannot be read.
        """
        mesh = read_glb(self.file, self._mapping())
        if not len(mesh.faces):
            raise WorldError(f"world {self.file}: has no faces; export its surfaces")
        if len(mesh.faces) > _MOST_FACES:
            raise WorldError(f"world {self.file}: more than {_MOST_FACES:,} triangles; simplify it")
        points = np.concatenate([lane.centre for lane in streets.lanes if lane.use == "drive"])
        low, high = mesh.bounds.astype(np.float64)
        share = float(Ground(mesh).lies_under(points).mean())
        if share < _FEWEST_SHARE:
            raise WorldError(
                f"world {self.file}: only {share:.0%} of the streets have a surface in it; it reaches from "
                f"({low[0]:.0f}, {low[1]:.0f}, {low[2]:.0f}) to ({high[0]:.0f}, {high[1]:.0f}, {high[2]:.0f}) m east, "
                "north and up: export it in the network's axes, y up, in metres"
            )
        return mesh

    def _mapping(self) -> dict[str, str]:
        """The material of each name in the file."""
        names = material_names(self.file)
        if not any(names):
            raise WorldError(
                f"world {self.file}: its faces have no named materials; name them, such as asphalt or brick"
            )
        known = {name: self.materials.get(name) or sorted_by_words(name) for name in names}
        strange = sorted(name for name, material in known.items() if material is None)
        if strange:
            raise WorldError(
                f"world {self.file}: materials {', '.join(map(repr, strange[:6]))} mean nothing here; say what they "
                f"are, world: {{file: {self.file}, materials: {{{strange[0] or 'NAME'}: concrete}}}}"
            )
        return {name: material for name, material in known.items() if material is not None}


def sorted_by_words(name: str) -> str | None:
    """The material that a name means; None if no word of it is known."""
    if name in MATERIALS:
        return name
    known = [_MATERIAL_OF[word] for word in split_words(name) if word in _MATERIAL_OF]
    return known[-1] if known else None

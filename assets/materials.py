"""The table of materials: reflectance at 905 nm and appearance of every surface."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

Rgb = tuple[float, float, float]
MOST_MATERIALS = 256  # rows are uint8


@dataclass(frozen=True)
class Material:
    """Optical properties of a named surface.

    Attributes:
        name: key used in meshes, glTF files and `twin/materials.yaml`.
        reflectance: diffuse reflectance at 905 nm, 0–1. For a `paint` material the value is the default;
            the instance's own paint replaces it.
        rgb: visible diffuse colour, linear, 0–1 per channel.
        kind: `opaque` or `glass` (the class of `twin/materials.yaml`).
        retro: retro-reflective: returns far more than a Lambertian surface towards the sensor.
        metal: bare metal, able to mirror a beam.
        road: part of the carriageway, wetted by rain.
        paint: takes the instance's paint.
        glow: bool, emits light: a lit lamp, visible only to cameras.
    """

    name: str
    reflectance: float
    rgb: Rgb
    kind: Literal["opaque", "glass"] = "opaque"
    retro: bool = False
    metal: bool = False
    road: bool = False
    paint: bool = False
    glow: bool = False

    @property
    def albedo(self) -> float:
        """Visible albedo, 0–1: luminance of `rgb` (ITU-R BT.709 weights)."""
        r, g, b = self.rgb
        return round(0.2126 * r + 0.7152 * g + 0.0722 * b, 4)


_TABLE = (
    # streets and ground
    Material("asphalt", 0.25, (0.16, 0.16, 0.165), road=True),
    Material("asphalt_patch", 0.19, (0.11, 0.11, 0.115), road=True),
    Material("road_marking", 0.60, (0.80, 0.80, 0.78), road=True),
    Material("manhole", 0.30, (0.10, 0.10, 0.10), metal=True, road=True),
    Material("kerb", 0.42, (0.48, 0.47, 0.45)),
    Material("paving", 0.38, (0.42, 0.41, 0.39)),
    Material("cobble", 0.32, (0.30, 0.29, 0.28)),
    Material("gravel", 0.34, (0.40, 0.38, 0.34)),
    Material("grass", 0.48, (0.13, 0.22, 0.06)),
    Material("soil", 0.34, (0.25, 0.19, 0.13)),
    # buildings
    Material("plaster_white", 0.68, (0.78, 0.77, 0.73)),
    Material("plaster_yellow", 0.60, (0.72, 0.60, 0.38)),
    Material("plaster_grey", 0.45, (0.45, 0.45, 0.45)),
    Material("plaster_red", 0.50, (0.55, 0.30, 0.22)),
    Material("brick", 0.42, (0.42, 0.20, 0.14)),
    Material("concrete", 0.40, (0.46, 0.45, 0.43)),
    Material("stone", 0.38, (0.44, 0.40, 0.34)),
    Material("cladding_metal", 0.45, (0.50, 0.52, 0.54), metal=True),
    Material("roof_tile", 0.40, (0.38, 0.15, 0.10)),
    Material("roof_slate", 0.18, (0.14, 0.15, 0.17)),
    Material("roof_flat", 0.22, (0.28, 0.27, 0.26)),
    Material("window_frame", 0.65, (0.75, 0.75, 0.74)),
    Material("window_glass", 0.08, (0.12, 0.16, 0.18), kind="glass"),
    Material("room_interior", 0.20, (0.06, 0.06, 0.07)),
    Material("door", 0.35, (0.26, 0.16, 0.10)),
    # vegetation
    Material("bark", 0.35, (0.20, 0.14, 0.09)),
    Material("foliage", 0.48, (0.10, 0.20, 0.05)),
    Material("foliage_dark", 0.44, (0.05, 0.12, 0.04)),
    Material("hedge", 0.46, (0.08, 0.17, 0.05)),
    # street furniture
    Material("wood", 0.45, (0.40, 0.27, 0.15)),
    Material("steel_galvanised", 0.45, (0.50, 0.51, 0.52), metal=True),
    Material("steel_painted", 0.35, (0.12, 0.20, 0.16)),
    Material("plastic_dark", 0.12, (0.05, 0.05, 0.055)),
    Material("plastic_bright", 0.50, (0.60, 0.42, 0.08)),
    Material("sign_face", 0.80, (0.75, 0.75, 0.78), retro=True),
    Material("sign_back", 0.40, (0.40, 0.41, 0.42), metal=True),
    Material("signal_housing", 0.10, (0.04, 0.045, 0.04)),
    Material("signal_lens", 0.30, (0.07, 0.065, 0.06)),
    # vehicles
    Material("car_paint", 0.45, (0.35, 0.35, 0.36), paint=True),
    Material("car_trim", 0.08, (0.035, 0.035, 0.035)),
    Material("car_glass", 0.08, (0.06, 0.08, 0.08), kind="glass"),
    Material("car_interior", 0.06, (0.07, 0.07, 0.075)),
    Material("car_seat", 0.08, (0.11, 0.10, 0.10)),
    Material("underbody", 0.08, (0.02, 0.02, 0.02)),
    Material("tyre", 0.06, (0.025, 0.025, 0.025)),
    Material("wheel_rim", 0.50, (0.48, 0.48, 0.50), metal=True),
    Material("chrome", 0.60, (0.62, 0.62, 0.64), metal=True),
    Material("mirror", 0.55, (0.40, 0.42, 0.45), metal=True),
    Material("headlamp", 0.60, (0.72, 0.72, 0.74), retro=True),
    Material("tail_lamp", 0.55, (0.45, 0.03, 0.03), retro=True),
    Material("number_plate", 0.85, (0.80, 0.80, 0.76), retro=True),
    Material("tarpaulin", 0.50, (0.32, 0.36, 0.50), paint=True),
    Material("cargo_box", 0.60, (0.66, 0.66, 0.65), paint=True),
    # people
    Material("skin", 0.55, (0.52, 0.36, 0.28)),
    Material("hair", 0.15, (0.08, 0.06, 0.05)),
    Material("clothing", 0.45, (0.22, 0.24, 0.32), paint=True),
    Material("clothing_dark", 0.30, (0.07, 0.08, 0.12)),
    Material("shoe", 0.12, (0.05, 0.04, 0.04)),
    Material("helmet", 0.50, (0.55, 0.10, 0.08)),
    # print on signs
    Material("sign_red", 0.75, (0.55, 0.02, 0.02), retro=True),
    Material("sign_blue", 0.60, (0.02, 0.08, 0.35), retro=True),
    Material("sign_yellow", 0.80, (0.80, 0.55, 0.03), retro=True),
    Material("sign_black", 0.15, (0.02, 0.02, 0.02)),
    # lit lamps
    Material("lamp_brake", 0.55, (1.0, 0.06, 0.04), retro=True, glow=True),
    Material("lamp_red", 0.30, (1.0, 0.05, 0.04), glow=True),
    Material("lamp_amber", 0.30, (1.0, 0.50, 0.04), glow=True),
    Material("lamp_green", 0.30, (0.10, 0.95, 0.50), glow=True),
    # tram tracks
    Material("rail", 0.38, (0.36, 0.35, 0.34), metal=True, road=True),
)


class MaterialTable:
    """Materials by row, as meshes and hits number them; the built-in ones first.

    Args:
        materials: at most 256, one a name.
    """

    def __init__(self, materials: Iterable[Material]) -> None:
        self.materials = {material.name: material for material in materials}
        self.names: tuple[str, ...] = tuple(self.materials)
        if len(self.names) > MOST_MATERIALS:
            raise ValueError(f"{len(self.names)} materials are more than the {MOST_MATERIALS} that rows can number")
        self._rows = {name: row for row, name in enumerate(self.names)}
        self._columns: dict[str, np.ndarray] = {}

    def __contains__(self, name: object) -> bool:
        return name in self._rows

    def row(self, name: str) -> int:
        """Row of a material.

        Raises:
            KeyError: the name is not in the table.
        """
        try:
            return self._rows[name]
        except KeyError:
            raise KeyError(f"material {name!r} is not in the table; add it to assets/materials.py") from None

    def column(self, attribute: str) -> np.ndarray:
        """One attribute of all materials by row, (k,) (or (k, 3) for `rgb`); not to be written to."""
        if attribute not in self._columns:
            self._columns[attribute] = np.array([getattr(one, attribute) for one in self.materials.values()])
        return self._columns[attribute]

    def updated(self, others: Iterable[Material]) -> MaterialTable:
        """Return the table with materials of the same names replaced, and new ones at the end."""
        return MaterialTable({**self.materials, **{material.name: material for material in others}}.values())


TABLE = MaterialTable(_TABLE)
MATERIALS: dict[str, Material] = TABLE.materials
MATERIAL_NAMES: tuple[str, ...] = TABLE.names


def material_index(name: str) -> int:
    """Row of a material in the table.

    Raises:
        KeyError: the name is not in the table.
    """
    return TABLE.row(name)


def material_column(attribute: str) -> np.ndarray:
    """One attribute of all materials in table order, shape (k,) (or (k, 3) for `rgb`)."""
    return TABLE.column(attribute)

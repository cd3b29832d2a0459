"""The materials of a drive's twin, also of twins written by other tools."""

from __future__ import annotations

import logging
import struct
from collections.abc import Iterator
from pathlib import Path

from assets.documents import parse_json
from assets.external.material_words import sort_material
from assets.materials import MATERIALS, TABLE, Material, MaterialTable
from cosim.drives.files import read_bytes
from cosim.drives.kitti.drive import Drive
from cosim.drives.twin.materials import read_materials
from cosim.errors import FormatError

_LOG = logging.getLogger(__name__)
_WEIGHTS = (0.2126, 0.7152, 0.0722)  # luminance, ITU-R BT.709
_LIKE_NOTHING = "concrete"


def twin_materials(drive: Drive) -> MaterialTable:
    """The built-in table with what `twin/materials.yaml` says of its names, and of further ones.

    Without the file names are sorted by the words in them, and reflectance is the luminance of the base colour; a
    warning says so.

    Raises:
        FormatError: the file, or where there is none a glTF file, cannot be read.
    """
    if drive.materials_path is not None:
        entries = read_materials(drive.materials_path)
        return TABLE.updated(
            Material(
                name,
                entry.reflectance,
                (entry.albedo, entry.albedo, entry.albedo),
                entry.kind,
                retro=entry.retro,
                metal=entry.metal,
                road=entry.road,
                paint=entry.paint,
            )
            for name, entry in entries.items()
        )
    colours = {name: value for file in sorted((drive.base / "twin").rglob("*.glb")) for name, value in _colours(file)}
    if not colours:
        return TABLE
    _LOG.warning(
        "%s has no twin/materials.yaml: its %d materials are sorted by name, their reflectance is their colour's",
        drive.root,
        len(colours),
    )
    return TABLE.updated(_sorted(name, luminance) for name, luminance in colours.items())


def _sorted(name: str, luminance: float) -> Material:
    like = MATERIALS[sort_material(name) or _LIKE_NOTHING]
    return Material(
        name,
        luminance,
        (luminance, luminance, luminance),
        like.kind,
        retro=like.retro,
        metal=like.metal,
        road=like.road,
        paint=like.paint,
    )


def _colours(file: Path) -> Iterator[tuple[str, float]]:
    """Names and luminances of a binary glTF file's materials."""
    data = read_bytes(file)
    try:
        (length,) = struct.unpack_from("<I", data, 12)
        materials = parse_json(data[20 : 20 + length].decode("utf-8", "replace")).get("materials", [])
        for material in materials:
            colour = material.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1.0, 1.0, 1.0))
            luminance = sum(weight * float(part) for weight, part in zip(_WEIGHTS, colour[:3], strict=True))
            yield str(material.get("name", "")), min(max(luminance, 0.0), 1.0)
    except (struct.error, ValueError, TypeError, AttributeError) as error:
        raise FormatError(f"{file}: not a readable binary glTF file ({error}); export it as .glb") from None

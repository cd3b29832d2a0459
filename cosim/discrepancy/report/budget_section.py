"""Where an error comes from, as one bar."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from cosim.discrepancy.report.layout import LAYOUT
from cosim.report import Piece, section, stacked_bar

_COLOURS = {
    "noise": "#6b7688", "poses": "#5aa9ff", "objects": "#56c8c0", "map": "#a58bf0", "missing": "#ffb23e",
    "unexplained": "#f0606a",
}  # fmt: skip
_NAMES = {"map": "the map", "missing": "missing effects"}
_REMEDIES = {
    "noise": "nothing to mend: a model that is right has it, too",
    "poses": "mend the calibration and the poses of scans",
    "objects": "mend the places of labelled objects",
    "map": "mend the map",
    "missing": "mend the sensor model: the improved one has them",
    "unexplained": "not known",
}


def budget_section(parts: Mapping[str, float], *, text: str, why: Mapping[str, str] = MappingProxyType({})) -> str:
    """HTML; empty without parts.

    Args:
        parts: noise, poses, objects, map, missing and unexplained; they add up to the error.
        text: what the error is of (HTML).
        why: other words on some parts.
    """
    if not parts:
        return ""
    told = {**_REMEDIES, **why}
    pieces = [
        Piece(_NAMES.get(name, name), value, _COLOURS[name], told[name])
        for name, value in parts.items()
        if abs(value) >= LAYOUT.told or name in ("noise", "unexplained")
    ]
    bar = stacked_bar(pieces, "where the error comes from")
    return section("Where the error comes from", bar, text=text, anchor="budget")

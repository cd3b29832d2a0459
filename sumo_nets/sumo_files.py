"""Files with which SUMO is started."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from sumo_nets.recipe import Demand


def configuration(files: Mapping[str, str], demand: Demand) -> list[str]:
    """Return the lines of a `.sumocfg`.

    Args:
        files: option and value of every input.
        demand: how long it lasts.
    """
    options = {
        **files,
        "begin": "0",
        "end": f"{demand.duration_s:g}",
        "step-length": "0.1",
        "time-to-teleport": "-1",
        "collision.action": "warn",
        "pedestrian.striping.stripe-width": "0.75",
        "no-step-log": "true",
    }
    return [f"    <{name} value={quoteattr(value)}/>" for name, value in options.items()]


def write_xml(path: Path, root: str, lines: list[str]) -> None:
    """Write an XML file of one element and the lines within."""
    text = "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', f"<{root}>", *lines, f"</{root}>", ""])
    path.write_text(text, encoding="utf-8", newline="\n")

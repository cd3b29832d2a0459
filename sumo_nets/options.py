"""Options of the installed SUMO."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from sumo_nets.tools import run_tool
from sumo_nets.xml_guard import read_xml


@dataclass(frozen=True)
class Option:
    """One option of a `.sumocfg`.

    Attributes:
        name: the one that SUMO lists it under, of several.
        section: SUMO's heading for it, such as `input`, `output` or `processing`.
        is_file: whether its value names files.
    """

    name: str
    section: str
    is_file: bool


@lru_cache(maxsize=1)
def list_options() -> Mapping[str, Option]:
    """Every name of every option, short and outdated ones too.

    Raises:
        TownError: SUMO cannot be run.
    """
    with tempfile.TemporaryDirectory(prefix="cosim-") as folder:
        template = Path(folder) / "template.xml"
        run_tool("sumo", "--save-template", template)
        root = read_xml(template, "sumoConfiguration", "configuration")
    found: dict[str, Option] = {}
    for section in root:
        for element in section:
            option = Option(element.tag, section.tag, element.get("type") == "FILE")
            names = [element.tag, *element.get("synonymes", "").split(), *element.get("deprecated", "").split()]
            found |= dict.fromkeys(names, option)
    return found

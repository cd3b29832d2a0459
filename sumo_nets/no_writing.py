"""A stranger's scenario may be simulated, but not make SUMO write files or run scripts."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path

from sumo_nets.errors import TownError
from sumo_nets.xml_guard import read_xml

_INPUTS = frozenset(
    [
        "net-file",
        "net",
        "n",
        "route-files",
        "routes",
        "r",
        "additional-files",
        "additional",
        "a",
        "junction-taz",
        "weight-files",
        "weights",
        "w",
    ]
)
# SUMO's options that name a file, a port or a program all have one of these in them.
_OUTWARD = re.compile(
    r"output|log|save|file|prefix|dump|script|config|gui|remote|write|(?<!driver)state|load", re.IGNORECASE
)
_HARMLESS = frozenset(
    {
        "configuration",
        "sumoConfiguration",
        "output",
        "report",
        "gui_only",
        "gui",
        # switches and numbers that say how much is logged, not where
        "no-step-log",
        "step-log.period",
        "no-duration-log",
        "duration-log.disable",
        "duration-log.statistics",
        "log.timestamps",
        "log.processid",
    }
)
_ROOTS = ("additional", "add", "routes", "a", "rerouters", "calibrators", "shapes", "vTypes", "detectors")
_WRITING = frozenset({"file", "dest", "output", "destination", "outputs"})


def refuse_writing(config: Path, root: ET.Element, files: Iterable[Path]) -> None:
    """Look through a configuration and the files it names for whatever makes SUMO write or run anything.

    Args:
        config: of the scenario.
        root: what it holds.
        files: its additional and route files.

    Raises:
        TownError: there is such a thing, or a file is not whole XML.
    """
    for element in root.iter():
        tag = str(element.tag)
        if tag not in _INPUTS | _HARMLESS and _OUTWARD.search(tag) and len(element) == 0:
            raise TownError(f"{config}: <{tag}> lets SUMO read or write other files; remove it")
    for path in files:
        for element in read_xml(path, *_ROOTS).iter():
            written = _WRITING.intersection(element.attrib)
            if written or element.tag == "include":
                what = f"<{element.tag} {min(written)}=…>" if written else "<include>"
                raise TownError(f"{path}: {what} lets SUMO read or write other files; remove it")

"""Remove outputs and references to other files from the files that SUMO reads."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from sumo_nets.errors import TownError
from sumo_nets.xml_guard import read_xml

# Measure only; nothing in a simulation depends on them.
_OUTPUTS = frozenset({"edgeData", "laneData", "meandata", "routeProbe", "vTypeProbe", "timedEvent"})
# Traffic signals may depend on what these see: they stay, and write into nothing.
_DETECTORS = frozenset(
    {"e1Detector", "inductionLoop", "instantInductionLoop", "e2Detector", "laneAreaDetector", "e3Detector"}
    | {"entryExitDetector"}
)
_READERS = frozenset({"rerouter", "variableSpeedSign"})  # may hold their intervals in a file of their own
_WRITTEN = ("file", "dest", "output", "destination", "outputs")
_NOWHERE = "NUL"  # SUMO's word for it, on every system
_WRITING_PARAMETER = re.compile(r"(^|\.)(file|output|dest)$|^(has|device)\.ssm\.", re.IGNORECASE)
_DEEPEST = 10  # files that include each other


@dataclass(eq=False)
class Cleaning:
    """Cleans the files of one scenario.

    Attributes:
        folder: of the scenario; files that are named within files must lie in it.
        changed: new contents of the files that were changed.
        left_out: descriptions of what was removed.
    """

    folder: Path
    changed: dict[Path, bytes] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)

    def clean(self, path: Path, *roots: str) -> ET.Element:
        """Read a file, and store its contents without outputs.

        Args:
            path: plain or gzipped XML.
            roots: names its outermost element may have; any, if there are none.

        Raises:
            TownError: it is not whole XML, or names a file outside the scenario's folder.
        """
        root = read_xml(path, *roots)
        if self._cleaned(root, path, depth=0):
            self.changed[path] = ET.tostring(root, encoding="utf-8", xml_declaration=True)
        return root

    def within(self, name: str, beside: Path, what: str) -> Path:
        """The path of a file that another names.

        Raises:
            TownError: it lies outside the scenario's folder, or does not exist.
        """
        path = (beside.parent / name).resolve()
        if not path.is_relative_to(self.folder.resolve()):
            raise TownError(
                f"{beside}: {what} names {name}, which lies outside {self.folder}; "
                "copy the file beside the scenario and name that"
            )
        if not path.exists():
            raise TownError(f"{beside}: {what} names {name}, which does not exist in {path.parent}")
        return path

    def _cleaned(self, parent: ET.Element, path: Path, depth: int) -> bool:
        """Clean an element's descendants; return whether anything changed."""
        changed = False
        for number, element in reversed(list(enumerate(parent))):
            if element.tag == "include":
                parent[number : number + 1] = self._included(element, path, depth)
                changed = True
            elif element.tag in _OUTPUTS or _is_writing_parameter(element):
                parent.remove(element)
                self._leave_out(element)
                changed = True
            else:
                changed |= self._attributes(element, path)
                changed |= len(element) > 0 and self._cleaned(element, path, depth)
        return changed

    def _attributes(self, element: ET.Element, path: Path) -> bool:
        if element.tag in _READERS and element.get("file"):
            name = element.get("file", "")
            target = self.within(name, path, f"<{element.tag}>")
            intervals = read_xml(target)
            self._cleaned(intervals, target, depth=1)
            element.extend(list(intervals))
            del element.attrib["file"]
            return True
        written = [name for name in _WRITTEN if name in element.attrib]
        if not written:
            return False
        if element.tag in _DETECTORS:
            element.attrib.update(dict.fromkeys(written, _NOWHERE))
        else:
            for name in written:
                del element.attrib[name]
        self._leave_out(element)
        return True

    def _included(self, element: ET.Element, path: Path, depth: int) -> list[ET.Element]:
        """Contents of an included file, which replace the element that names it."""
        if depth >= _DEEPEST:
            raise TownError(f"{path}: files include each other more than {_DEEPEST} deep; write them as one")
        target = self.within(element.get("href", ""), path, "<include>")
        root = read_xml(target)
        self._cleaned(root, target, depth + 1)
        return list(root)

    def _leave_out(self, element: ET.Element) -> None:
        name = element.get("id") or element.get("type") or element.get("key") or ""
        self.left_out.append(f"{element.tag} {name}".strip())


def named_files(value: str) -> list[str]:
    """The names in an option's value."""
    return [name.strip() for name in value.split(",") if name.strip()]


def summary(words: Mapping[str, int] | list[str], most: int = 8) -> str:
    """A list for one line of a message, cut where it is long."""
    distinct = list(dict.fromkeys(words))
    more = f" and {len(distinct) - most} more" if len(distinct) > most else ""
    return ", ".join(distinct[:most]) + more


def _is_writing_parameter(element: ET.Element) -> bool:
    return element.tag == "param" and bool(_WRITING_PARAMETER.search(element.get("key", "")))

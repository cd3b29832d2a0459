"""Preparation of a user's SUMO scenario, without its output files, by the options of the installed SUMO."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from xml.sax.saxutils import quoteattr

from sumo_nets.cleaning import Cleaning, named_files, summary
from sumo_nets.errors import TownError
from sumo_nets.sumo_files import write_xml
from sumo_nets.tools import run_tool
from sumo_nets.xml_guard import read_xml

_SECTIONS_LEFT_OUT = frozenset({"output", "report", "traci_server", "gui_only", "ssm_device", "mesoscopic"})
_XML_INPUTS = frozenset({"net-file", "route-files", "additional-files", "weight-files", "load-state"})
_OTHER_INPUTS = frozenset(
    {"astar.all-distances", "astar.landmark-distances", "device.fcd-replay.files", "phemlight-path"}
)
_SAID = frozenset({"remote-port", "mesosim", "device.ssm.probability", "device.ssm.explicit"})  # besides files
_FALSE = frozenset({"", "false", "0", "no", "off", "-"})


@dataclass(frozen=True)
class Scenario:
    """Contents of a `.sumocfg`, and the part that is simulated.

    Attributes:
        config: the file.
        files: XML files by the option that names them.
        options: all others that are kept, with their values.
        changed: what files hold without their outputs, of those that have any.
        left_out: outputs, ports and the like that are not taken over, in words.
    """

    config: Path
    files: Mapping[str, tuple[Path, ...]]
    options: Mapping[str, str]
    changed: Mapping[Path, bytes]
    left_out: tuple[str, ...]

    @property
    def net(self) -> Path:
        """The network."""
        return self.files["net-file"][0]

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for the user, one line each."""
        return (
            f"{self.config}: left out, as it writes, listens or is of no use here: {summary([*self.left_out])}",
        ) * bool(self.left_out)

    def write(self, folder: Path) -> Path:
        """Write a configuration that simulates it, and those of its files that must not stay as they are.

        Args:
            folder: made if missing.

        Returns:
            The `.sumocfg`, whose own files are not moved.
        """
        folder.mkdir(parents=True, exist_ok=True)
        options = dict(self.options)
        for option in self.files:
            options[option] = ",".join(str(path) for path in self.readable(option, folder))
        options["xml-validation"] = "never"
        target = folder / self.config.name
        lines = [f"    <{name} value={quoteattr(value)}/>" for name, value in options.items()]
        write_xml(target, "configuration", lines)
        return target

    def readable(self, option: str, folder: Path) -> tuple[Path, ...]:
        """The files of an option as SUMO may read them; those that are changed are written to a folder."""
        paths = []
        for number, path in enumerate(self.files.get(option, ())):
            if path in self.changed:
                copy = folder / f"{option}-{number}-{path.name.removesuffix('.gz')}"
                copy.write_bytes(self.changed[path])
                paths.append(copy)
            else:
                paths.append(path)
        return tuple(paths)


def read_scenario(config: Path) -> Scenario:
    """Read a `.sumocfg` and all that it names.

    Outputs, open ports and whatever belongs to SUMO's window are left out. Files that its options name may lie
    anywhere as long as they are XML; other files, and those that files name, must lie in its folder.

    Raises:
        TownError: a file that cannot be used, another configuration, or no network.
    """
    root = read_xml(config, "configuration", "sumoConfiguration")
    cleaning = Cleaning(config.parent)
    files: dict[str, tuple[Path, ...]] = {}
    options: dict[str, str] = {}
    given, unknown = _given(root)
    for name, value in given:
        option = _list_options()[name]
        if option.section == "configuration":
            raise TownError(f"{config}: <{name}> names another configuration; copy what it holds into this one")
        if option.name in _XML_INPUTS:
            files[option.name] = files.get(option.name, ()) + _xml_files(option.name, value, config, cleaning)
        elif option.section in _SECTIONS_LEFT_OUT or (option.is_file and option.name not in _OTHER_INPUTS):
            is_noted = (option.is_file and option.section != "gui_only") or option.name in _SAID
            if is_noted and value.lower() not in _FALSE:
                cleaning.left_out.append(name)
        else:
            options[option.name] = _absolute(value, config, cleaning, name) if option.is_file else value
    if len(files.get("net-file", ())) != 1:
        number = len(files.get("net-file", ()))
        raise TownError(f'{config}: names {number} networks, where it must name one as <net-file value="…"/>')
    return Scenario(config, files, options, cleaning.changed, (*cleaning.left_out, *unknown))


def _given(root: ET.Element) -> tuple[list[tuple[str, str]], list[str]]:
    """Options and values, whatever sections they are listed in; and names that are none."""
    found = []
    sections = {option.section for option in _list_options().values()} | {root.tag}
    unknown = []
    for element in root.iter():
        name = str(element.tag)
        if element is not root and name in _list_options():
            text = element.get("value") or element.get("v") or (element.text or "").strip()
            found.append((name, text))
        elif name not in sections and len(element) == 0:
            unknown.append(f"{name} (unknown to this SUMO)")
    return found, unknown


def _xml_files(option: str, value: str, config: Path, cleaning: Cleaning) -> tuple[Path, ...]:
    paths = tuple((config.parent / name).resolve() for name in named_files(value))
    for path in paths:
        if not path.is_file():
            raise TownError(f"{config}: names {path.name}, which does not exist in {path.parent}")
        cleaning.clean(path, *(("net",) if option == "net-file" else ()))
    return paths


def _absolute(value: str, config: Path, cleaning: Cleaning, name: str) -> str:
    return ",".join(str(cleaning.within(one, config, f"<{name}>")) for one in named_files(value))


@dataclass(frozen=True)
class _Option:
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
def _list_options() -> Mapping[str, _Option]:
    """Every name of every option, short and outdated ones too.

    Raises:
        TownError: SUMO cannot be run.
    """
    with tempfile.TemporaryDirectory(prefix="cosim-") as folder:
        template = Path(folder) / "template.xml"
        run_tool("sumo", "--save-template", template)
        root = read_xml(template, "sumoConfiguration", "configuration")
    found: dict[str, _Option] = {}
    for section in root:
        for element in section:
            option = _Option(element.tag, section.tag, element.get("type") == "FILE")
            names = [element.tag, *element.get("synonymes", "").split(), *element.get("deprecated", "").split()]
            found |= dict.fromkeys(names, option)
    return found

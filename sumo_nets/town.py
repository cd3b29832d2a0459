"""A town that is ready to run: a built-in one, or a user's own SUMO configuration."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from assets.streets import Streets
from sumo_nets.errors import TownError
from sumo_nets.no_writing import refuse_writing
from sumo_nets.parking import Lot, read_parking
from sumo_nets.reader import read_network, read_streets
from sumo_nets.recipes import RECIPES, TOWNS
from sumo_nets.tools import run_tool
from sumo_nets.type_table import TypeTable, read_types
from sumo_nets.xml_guard import read_xml

_BUILT = Path(__file__).parent / "towns"


@dataclass(frozen=True)
class Town:
    """A town's files and streets.

    Attributes:
        name: built-in name, or the stem of the user's `.sumocfg`.
        folder: where its files are.
        sumocfg: the configuration to start SUMO with.
        net: the network.
        additional: further files, with vehicle types and parking areas.
        style: what it looks like, as `Streets.style`.
        streets: its geometry, world metres (x east, y north, z up).
    """

    name: str
    folder: Path
    sumocfg: Path
    net: Path
    additional: tuple[Path, ...]
    style: str
    streets: Streets

    @cached_property
    def network(self) -> Any:
        """The network as sumolib reads it, without what lies inside junctions."""
        return read_network(self.net)

    @cached_property
    def lots(self) -> tuple[Lot, ...]:
        """Kerbside parking."""
        return read_parking(self.additional)

    @cached_property
    def types(self) -> TypeTable:
        """Vehicle types.

        Raises:
            TownError: none is defined, or their files are broken.
        """
        return read_types(self.additional)


def read_town(name_or_path: str | Path) -> Town:
    """Read a built-in town by name, or any town by the path of its `.sumocfg` or of the folder that holds it.

    Raises:
        TownError: there is no such town, or its files cannot be used.
    """
    built_in = str(name_or_path) in RECIPES
    name = str(name_or_path)
    config = built_in_folder(name) / f"{name}.sumocfg" if built_in else _find_config(Path(name_or_path))
    net, additional = _inputs(config, built_in=built_in)
    if not built_in:
        _try_in_sumo(net)
    style = RECIPES[name].style if built_in else "suburb"
    streets = read_streets(config.stem, net, additional, style)
    return Town(config.stem, config.parent, config, net, additional, style, streets)


def built_in_folder(name: str) -> Path:
    """Where the files of a built-in town are."""
    return _BUILT / name


def _find_config(path: Path) -> Path:
    if path.is_dir():
        found = sorted(path.glob("*.sumocfg"))
        if len(found) != 1:
            raise TownError(f"{path}: holds {len(found)} .sumocfg files; give the path of the one to use")
        return found[0].resolve()
    if path.suffix == ".sumocfg" and path.is_file():
        return path.resolve()
    if path.exists():
        raise TownError(f"{path}: is not a .sumocfg; give the path of a SUMO configuration")
    names = ", ".join(TOWNS)
    raise TownError(f"town {str(path)!r} does not exist; choose one of {names}, or give the path of a .sumocfg")


def _inputs(config: Path, *, built_in: bool) -> tuple[Path, tuple[Path, ...]]:
    """Return the network and the additional files that a configuration names."""
    root = read_xml(config, "configuration", "sumoConfiguration")
    routes = _files(root, config, ("route-files", "routes", "r"))
    nets = _files(root, config, ("net-file", "net", "n"))
    if len(nets) != 1:
        raise TownError(f'{config}: names {len(nets)} networks, where it must name one as <net-file value="…"/>')
    additional = _files(root, config, ("additional-files", "additional", "a"))
    for path in (*nets, *additional, *routes):
        if not path.is_file():
            raise TownError(f"{config}: names {path.name}, which does not exist in {path.parent}")
    if not built_in:
        refuse_writing(config, root, (*additional, *routes))
    return nets[0], tuple(additional)


def _files(root: ET.Element, config: Path, keys: tuple[str, ...]) -> list[Path]:
    values = [element.get("value", "") for element in root.iter() if element.tag in keys]
    names = [name.strip() for value in values for name in value.split(",") if name.strip()]
    return [(config.parent / name).resolve() for name in names]


def _try_in_sumo(net: Path) -> None:
    """Let SUMO load a network: its own reader is the judge of what it accepts."""
    read_xml(net, "net")
    try:
        run_tool("sumo", "--net-file", net, "--end", "0", "--no-step-log", "--xml-validation", "never")
    except TownError as error:
        raise TownError(f"{net}: SUMO refuses it ({error})") from error

"""A town that can be simulated: a built-in one, or a user's own SUMO configuration."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from assets.cache import cached_latest
from assets.streets import Streets
from sumo_nets.errors import TownError
from sumo_nets.lanelets import read_lanelets
from sumo_nets.local_origin import ZERO, find_origin, move_file, move_scenario, move_streets, net_origin
from sumo_nets.parking import Lot, read_parking
from sumo_nets.reader import not_drawn, read_network, read_streets
from sumo_nets.recipes import RECIPES, TOWNS
from sumo_nets.scenario import Scenario, read_scenario
from sumo_nets.tools import run_tool
from sumo_nets.type_table import TypeTable, read_types
from sumo_nets.xml_guard import read_xml

_BUILT = Path(__file__).parent / "towns"
_OWN_STYLE = "suburb"


@dataclass(frozen=True)
class Town:
    """A town's files and streets.

    Attributes:
        name: built-in name, or the stem of the user's `.sumocfg`.
        folder: where its files are.
        sumocfg: the configuration to start SUMO with.
        net: the network, in local coordinates (see `Streets.origin_m`).
        additional: further files, with vehicle types and parking areas.
        style: what it looks like, as `Streets.style`.
        streets: its geometry, world metres (x east, y north, z up).
        scenario: the simulated part of the user's own configuration; None for a built-in town.
        notes: parts of a user's own scenario that are left out, one line each.
        streets_only: whether no traffic is simulated, as road users follow trajectories.
    """

    name: str
    folder: Path
    sumocfg: Path
    net: Path
    additional: tuple[Path, ...]
    style: str
    streets: Streets
    scenario: Scenario | None = None
    notes: tuple[str, ...] = ()
    streets_only: bool = False

    @property
    def is_built_in(self) -> bool:
        """Whether it is one of the towns of this package."""
        return self.scenario is None and not self.streets_only

    @property
    def type_files(self) -> tuple[Path, ...]:
        """Files that may define vehicle types."""
        routes = () if self.scenario is None else self.scenario.files.get("route-files", ())
        return (*self.additional, *routes)

    def runnable(self, folder: Path) -> Path:
        """A configuration that SUMO may be started with; that of a user's scenario is written to a folder."""
        return self.sumocfg if self.scenario is None else self.scenario.write(folder)

    def runnable_additional(self, folder: Path) -> tuple[Path, ...]:
        """The additional files as SUMO may read them; those that must be changed are written to a folder."""
        return self.additional if self.scenario is None else self.scenario.readable("additional-files", folder)

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

    The path of a SUMO network or of a CommonRoad scenario gives only its streets.

    Raises:
        TownError: there is no such town, or its files cannot be used.
    """
    name = str(name_or_path)
    if name in RECIPES:
        folder = built_in_folder(name)
        net, additional = folder / f"{name}.net.xml", (folder / f"{name}.add.xml",)
        style = RECIPES[name].style
        contents = tuple(hashlib.sha256(path.read_bytes()).hexdigest() for path in (net, *additional))
        streets = _read_built_in(name, contents, style, net=net, additional=additional)
        return Town(name, folder, folder / f"{name}.sumocfg", net, additional, style, streets)
    path = Path(name_or_path)
    if path.is_file() and path.name.removesuffix(".gz").endswith(".xml"):
        return _read_streets_only(path)
    scenario = read_scenario(_find_config(path))
    notes = (*scenario.notes, *not_drawn(scenario.net))
    origin = net_origin(scenario.net)
    if origin != ZERO:
        scenario = move_scenario(scenario, origin)
    config, net, additional = scenario.config, scenario.net, scenario.files.get("additional-files", ())
    _try_in_sumo(net)
    streets = replace(read_streets(config.stem, net, additional, _OWN_STYLE), origin_m=origin)
    if not any(lane.use == "drive" for lane in streets.lanes):
        raise TownError(
            f"{net}: has no lane for road vehicles, so nothing can carry the sensors; give one with streets"
        )
    return Town(config.stem, config.parent, config, net, additional, _OWN_STYLE, streets, scenario, notes)


@cached_latest(len(TOWNS), ignore=("net", "additional"))
def _read_built_in(
    name: str, contents: tuple[str, ...], style: str, *, net: Path, additional: tuple[Path, ...]
) -> Streets:
    """Streets of a built-in town, or what an earlier process read of files with these contents (SHA-256)."""
    return read_streets(name, net, additional, style)


def _read_streets_only(path: Path) -> Town:
    """Streets from a SUMO network or a CommonRoad scenario."""
    path = path.resolve()
    root = read_xml(path, "net", "commonRoad")
    name = path.name.partition(".")[0]
    if root.tag == "commonRoad":
        streets, notes, net = read_lanelets(path, root, _OWN_STYLE), (), path
        origin = find_origin(np.concatenate([lane.centre[:, :2] for lane in streets.lanes]))
        streets = move_streets(streets, origin) if origin != ZERO else streets
    else:
        origin = net_origin(path)
        net = path if origin == ZERO else move_file(path, root, origin)
        _try_in_sumo(net)
        streets, notes = replace(read_streets(name, net, (), _OWN_STYLE), origin_m=origin), not_drawn(path)
    return Town(name, path.parent, net, net, (), _OWN_STYLE, streets, notes=notes, streets_only=True)


def built_in_folder(name: str) -> Path:
    """Return the folder of a built-in town."""
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


def _try_in_sumo(net: Path) -> None:
    """Validate a network by loading it with SUMO."""
    try:
        run_tool("sumo", "--net-file", net, "--end", "0", "--no-step-log", "--xml-validation", "never")
    except TownError as error:
        raise TownError(f"{net}: SUMO refuses it ({error})") from error

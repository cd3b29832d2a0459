"""Random demand of one episode of a town."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sumo_nets.demand import make_demand
from sumo_nets.recipe import Demand
from sumo_nets.sumo_files import configuration, write_xml
from sumo_nets.town import Town


def write_demand(town: Town, demand: Demand, seed: int, folder: Path) -> Path:
    """Write a route file and a configuration that runs it on a town's network; returns the `.sumocfg`.

    The same town, demand and seed give the same population. Vehicle types are the town's; ids start with `veh`,
    `parked` and `ped`. No more vehicles park than the town has lots.

    Args:
        town: whose network, types and parking lots are used where they lie.
        demand: numbers of road users.
        seed: of every choice.
        folder: where to write; made if missing.

    Raises:
        TownError: the town has no vehicle types for the demand.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    lines = make_demand(demand, town.network, town.lots, town.types, rng)
    routes, config = folder / f"{town.name}.rou.xml", folder / f"{town.name}.sumocfg"
    write_xml(routes, "routes", lines)
    files = {"net-file": str(town.net.resolve())}
    if town.additional:
        files["additional-files"] = ",".join(str(path.resolve()) for path in town.additional)
    write_xml(config, "configuration", configuration({**files, "route-files": routes.name}, demand))
    return config

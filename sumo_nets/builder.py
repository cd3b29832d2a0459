"""Build a town's SUMO files from its recipe."""

from __future__ import annotations

import logging
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sumo_nets.demand import make_demand
from sumo_nets.errors import TownError
from sumo_nets.network import build_network
from sumo_nets.parking import make_parking, write_parking
from sumo_nets.planning import make_plan
from sumo_nets.reader import read_network
from sumo_nets.recipe import Recipe
from sumo_nets.relief import make_ground
from sumo_nets.sumo_files import configuration, write_xml
from sumo_nets.type_table import read_types
from sumo_nets.vtypes import make_vtypes, write_vtypes

if TYPE_CHECKING:
    from sumo_nets.vtypes import VehicleModel

_LOG = logging.getLogger(__name__)
_BEYOND_THE_STREETS_M = 60.0


def build_town(recipe: Recipe, folder: Path, models: Iterable[VehicleModel] | None = None) -> Path:
    """Build a town and return the path of its `.sumocfg`.

    Writes NAME.net.xml (network), NAME.add.xml (vehicle types, parking areas), NAME.rou.xml (demand) and NAME.sumocfg.
    The same recipe and models give the same bytes.

    Args:
        recipe: what to build.
        folder: made if missing; older files of the same names are replaced once everything is built.
        models: models to make vehicle types of; the whole catalogue by default.

    Raises:
        TownError: one of SUMO's programs refused its input, or the streets are not all connected.
    """
    if models is None:
        from assets.models.catalogue import CATALOGUE

        models = _specs(CATALOGUE)
    models = [model for model in models if model.kind != "tram" or recipe.demand.trams > 0]
    rng = np.random.default_rng(recipe.seed)
    with tempfile.TemporaryDirectory(prefix="town_") as temporary:
        workshop = Path(temporary)
        built = [workshop / f"{recipe.name}.{kind}" for kind in ("net.xml", "add.xml", "rou.xml", "sumocfg")]
        net, additional, routes, config = built
        plan = make_plan(recipe, rng, workshop)
        ground = make_ground(recipe.relief, float(np.abs(plan.positions).max()) + _BEYOND_THE_STREETS_M, rng)
        build_network(recipe, plan, ground, rng, net)
        network = read_network(net)
        _demand_connected(recipe.name, network)
        lots = make_parking(plan, recipe.streets, _lane_lengths(network), rng)
        parking = write_parking(lots, recipe.streets, network)
        write_xml(additional, "additional", write_vtypes(make_vtypes(models)) + parking)
        write_xml(routes, "routes", make_demand(recipe.demand, network, lots, read_types((additional,)), rng))
        files = {"net-file": net.name, "additional-files": additional.name, "route-files": routes.name}
        write_xml(config, "configuration", configuration(files, recipe.demand))
        folder.mkdir(parents=True, exist_ok=True)
        for path in built:
            shutil.copyfile(path, folder / path.name)
    _LOG.info("built %s: %d streets, %d parking lots", recipe.name, len(plan.streets), len(lots))
    return folder / config.name


def _specs(catalogue: Any) -> list[VehicleModel]:
    return list(catalogue.values() if isinstance(catalogue, dict) else catalogue)


def _lane_lengths(network: Any) -> dict[str, float]:
    return {lane.getID(): lane.getLength() for edge in network.getEdges() for lane in edge.getLanes()}


def _demand_connected(name: str, network: Any) -> None:
    """Raise `TownError` where a car cannot drive from every street to every other.

    Args:
        name: the town's, for the message.
        network: as sumolib reads it.
    """
    edges = [edge for edge in network.getEdges() if edge.allows("passenger")]
    if not edges:
        raise TownError(f"town {name!r} has no street that cars may use; give its layout some")
    piece = _pieces(edges)
    largest = np.bincount(piece).argmax()
    cut_off = [edge.getID() for edge, number in zip(edges, piece, strict=True) if number != largest]
    if cut_off:
        raise TownError(
            f"town {name!r} is disconnected: {len(cut_off)} of its {len(edges)} streets, {cut_off[0]!r} among them, "
            "cannot be reached from the others and left again; change its layout, or drop fewer streets"
        )


def _pieces(edges: list[Any]) -> np.ndarray:
    """Return the strongly connected component of every edge, by lane connections a car may use."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    number = {edge.getID(): i for i, edge in enumerate(edges)}
    ways = [
        (number[edge.getID()], number[target.getID()])
        for edge in edges
        for target, links in edge.getOutgoing().items()
        if target.getID() in number
        and any(link.getFromLane().allows("passenger") and link.getToLane().allows("passenger") for link in links)
    ]
    rows = np.array(ways, dtype=np.int64).reshape(-1, 2).T
    graph = csr_matrix((np.ones(len(ways)), rows), shape=(len(edges), len(edges)))
    return connected_components(graph, directed=True, connection="strong")[1]

"""From a recipe to the files SUMO runs: `build_town` is the recipe's whole story."""

from __future__ import annotations

import logging
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sumo_nets.demand import make_demand
from sumo_nets.network import build_network
from sumo_nets.parking import make_parking, write_parking
from sumo_nets.plan import make_plan
from sumo_nets.recipe import Recipe
from sumo_nets.relief import make_ground
from sumo_nets.vtypes import make_vtypes, write_vtypes

if TYPE_CHECKING:
    from sumo_nets.vtypes import Model

_LOG = logging.getLogger(__name__)
_BEYOND_THE_STREETS_M = 60.0


def build_town(recipe: Recipe, folder: Path, models: Iterable[Model] | None = None) -> Path:
    """Build a town and return the path of its `.sumocfg`.

    Writes NAME.net.xml (network), NAME.add.xml (vehicle types, parking areas), NAME.rou.xml (demand) and NAME.sumocfg.
    The same recipe and models give the same bytes.

    Args:
        recipe: what to build.
        folder: made if missing; older files of the same names are replaced once everything is built.
        models: models to make vehicle types of; the whole catalogue by default.

    Raises:
        TownError: one of SUMO's programs refused its input.
    """
    if models is None:
        from assets.models.catalogue import CATALOGUE

        models = _specs(CATALOGUE)
    rng = np.random.default_rng(recipe.seed)
    with tempfile.TemporaryDirectory(prefix="town_") as temporary:
        workshop = Path(temporary)
        built = [workshop / f"{recipe.name}.{kind}" for kind in ("net.xml", "add.xml", "rou.xml", "sumocfg")]
        net, additional, routes, config = built
        plan = make_plan(recipe, rng, workshop)
        ground = make_ground(recipe.relief, float(np.abs(plan.positions).max()) + _BEYOND_THE_STREETS_M, rng)
        build_network(recipe, plan, ground, rng, net)
        lots = make_parking(plan, _lane_lengths(net), rng)
        _write(additional, "additional", write_vtypes(make_vtypes(models)) + write_parking(lots, recipe.streets))
        _write(routes, "routes", make_demand(recipe.demand, net, lots, rng))
        _write(config, "configuration", _configuration(recipe))
        folder.mkdir(parents=True, exist_ok=True)
        for path in built:
            shutil.copyfile(path, folder / path.name)
    _LOG.info("built %s: %d streets, %d parking lots", recipe.name, len(plan.streets), len(lots))
    return folder / config.name


def _specs(catalogue: Any) -> list[Model]:
    return list(catalogue.values() if isinstance(catalogue, dict) else catalogue)


def _lane_lengths(net: Path) -> dict[str, float]:
    import sumolib

    edges = sumolib.net.readNet(str(net)).getEdges()
    return {lane.getID(): lane.getLength() for edge in edges for lane in edge.getLanes()}


def _configuration(recipe: Recipe) -> list[str]:
    options = {
        "net-file": f"{recipe.name}.net.xml",
        "additional-files": f"{recipe.name}.add.xml",
        "route-files": f"{recipe.name}.rou.xml",
        "begin": "0",
        "end": f"{recipe.demand.duration_s:g}",
        "step-length": "0.1",
        "time-to-teleport": "-1",
        "collision.action": "warn",
        "pedestrian.striping.stripe-width": "0.75",
        "no-step-log": "true",
    }
    return [f'    <{name} value="{value}"/>' for name, value in options.items()]


def _write(path: Path, root: str, lines: list[str]) -> None:
    text = "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', f"<{root}>", *lines, f"</{root}>", ""])
    path.write_text(text, encoding="utf-8", newline="\n")

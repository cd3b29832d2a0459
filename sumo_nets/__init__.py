"""Road networks: town recipes, the SUMO files built from them, and the builder."""

from sumo_nets.builder import build_town
from sumo_nets.demand_config import DemandConfig
from sumo_nets.episode_demand import write_demand
from sumo_nets.errors import TownError
from sumo_nets.recipe import Demand, KindShares, Recipe
from sumo_nets.recipes import RECIPES, TOWNS
from sumo_nets.town import Town, built_in_folder, read_town

__all__ = [
    "RECIPES",
    "TOWNS",
    "Demand",
    "DemandConfig",
    "KindShares",
    "Recipe",
    "Town",
    "TownError",
    "build_town",
    "built_in_folder",
    "read_town",
    "write_demand",
]

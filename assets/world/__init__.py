"""The static world of a town: ground, streets, buildings, plants and furniture."""

from assets.world.build import BuiltWorld, build_world
from assets.world.environment import PROP_KINDS, Environment, EnvironmentConfig, PropDensities
from assets.world.groundwork import Groundwork, lay_groundwork
from assets.world.props import SignalHead

__all__ = [
    "PROP_KINDS",
    "BuiltWorld",
    "Environment",
    "EnvironmentConfig",
    "Groundwork",
    "PropDensities",
    "SignalHead",
    "build_world",
    "lay_groundwork",
]

"""How drivers behave: habits from distributions, and incidents that happen now and then."""

from cosim.behaviour.config import BehaviourConfig
from cosim.behaviour.drivers import Drivers
from cosim.behaviour.events import Event

__all__ = ["BehaviourConfig", "Drivers", "Event"]

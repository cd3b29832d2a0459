"""How drivers behave: habits from distributions, and incidents that happen now and then."""

from cosim.traffic.behaviour.config import BehaviourConfig
from cosim.traffic.behaviour.drivers import Drivers
from cosim.traffic.behaviour.events import Event

__all__ = ["BehaviourConfig", "Drivers", "Event"]

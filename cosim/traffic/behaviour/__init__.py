"""Driver behaviour: parameters drawn from distributions, and random incidents."""

from cosim.traffic.behaviour.config import BehaviourConfig
from cosim.traffic.behaviour.drivers import Drivers
from cosim.traffic.behaviour.events import Event

__all__ = ["BehaviourConfig", "Drivers", "Event"]

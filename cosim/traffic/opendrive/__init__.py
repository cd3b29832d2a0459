"""Road networks of ASAM OpenDRIVE, for positions given in road and lane coordinates."""

from cosim.traffic.opendrive.network import RoadLocation, RoadNetwork, read_road_network
from cosim.traffic.opendrive.plan_view import clothoid
from cosim.traffic.opendrive.road import OpenDriveError, Road

__all__ = ["OpenDriveError", "Road", "RoadLocation", "RoadNetwork", "clothoid", "read_road_network"]

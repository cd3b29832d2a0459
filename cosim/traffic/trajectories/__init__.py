"""Trajectories of real or simulated traffic, read from files and replayed."""

from cosim.traffic.trajectories.read import read_trajectories
from cosim.traffic.trajectories.replay import Replay
from cosim.traffic.trajectories.tracks import RoadTracks, TrajectoryError

__all__ = ["Replay", "RoadTracks", "TrajectoryError", "read_trajectories"]

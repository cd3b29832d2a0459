"""Motion a sensor can believe: from SUMO's jumping poses to those of bodies with wheels."""

from cosim.traffic.motion.approach import Approach
from cosim.traffic.motion.footprint import Overlap, overlaps
from cosim.traffic.motion.motion import Motion
from cosim.traffic.motion.script import Script
from cosim.traffic.motion.turn_path import TurnError, plan_turn

__all__ = ["Approach", "Motion", "Overlap", "Script", "TurnError", "overlaps", "plan_turn"]

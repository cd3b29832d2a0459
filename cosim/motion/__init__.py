"""Motion a sensor can believe: from SUMO's jumping poses to those of bodies with wheels."""

from cosim.motion.approach import Approach
from cosim.motion.footprint import Overlap, overlaps
from cosim.motion.motion import Motion
from cosim.motion.script import Script
from cosim.motion.turn_path import TurnError, plan_turn

__all__ = ["Approach", "Motion", "Overlap", "Script", "TurnError", "overlaps", "plan_turn"]

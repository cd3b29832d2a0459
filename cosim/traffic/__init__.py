"""Traffic: SUMO's simulation, driver behaviour, and the motion of the vehicles."""

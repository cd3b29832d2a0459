"""Who drives, and how: SUMO's simulation, the drivers' behaviour, and the motion of their vehicles."""

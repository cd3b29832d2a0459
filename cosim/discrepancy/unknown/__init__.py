"""Unknown effects: measured curves, their formulas, and the effects that they make, in memory and as files."""

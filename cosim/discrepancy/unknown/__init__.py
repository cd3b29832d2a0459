"""Unknown effects: measured curves, their formulas, and effects built from them, in memory and as files."""

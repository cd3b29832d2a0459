"""Trees, bushes, hedges and climbers, and where they are planted."""

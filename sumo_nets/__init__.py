"""Where traffic runs: town recipes, their built SUMO files and the builder."""

"""Measured beams, their twin, and the selection of beams and frames that can be compared."""

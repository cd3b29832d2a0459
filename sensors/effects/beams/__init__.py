"""Origin, direction and time of the beams."""

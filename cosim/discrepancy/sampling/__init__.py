"""Some beams of a whole drive: which are taken, and what is known of them."""

"""Effects that add or remove returns of a whole scan."""

"""Street furniture: signals, signs, lamps, overhead lines and the props of pavements, and their places."""

"""What was measured, what the twin says of it, and which beams may be compared."""

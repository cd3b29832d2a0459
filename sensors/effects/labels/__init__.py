"""What annotators make of it."""

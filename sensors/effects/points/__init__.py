"""What range and intensity are reported of a point."""

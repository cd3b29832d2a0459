"""Reported range and intensity of a point."""

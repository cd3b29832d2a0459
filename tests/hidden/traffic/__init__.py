"""Measured traffic with hidden driver behaviour, made with SUMO only."""

"""Received power, and the intensity computed from it."""

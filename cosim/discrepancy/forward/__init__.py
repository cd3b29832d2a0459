"""Prediction of each beam by a sensor model."""

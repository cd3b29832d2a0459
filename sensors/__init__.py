"""Sensor simulation: scene, ray tracing, beam patterns, LiDAR and cameras."""

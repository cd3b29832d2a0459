"""How the world is measured: scene, ray tracing, beam patterns, LiDAR and cameras."""

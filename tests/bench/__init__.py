"""Benchmarks: timings as ratios, printed by `make bench`."""

"""Calibration of a sensor model on a recording: pattern, map and diagnosis are repeated until nothing changes."""

from cosim.recordings.calibration.loop import Calibration, calibrate

__all__ = ["Calibration", "calibrate"]

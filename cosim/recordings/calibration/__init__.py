"""Calibration of a sensor model on a recording: pattern, map and diagnosis are repeated until nothing changes."""

from cosim.recordings.calibration.loop import SensorCalibration, calibrate

__all__ = ["SensorCalibration", "calibrate"]

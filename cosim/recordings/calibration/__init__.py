"""Calibration of a sensor model on a recording: pattern, map, diagnosis, and the map anew, until nothing changes."""

from cosim.recordings.calibration.loop import Calibration, calibrate

__all__ = ["Calibration", "calibrate"]

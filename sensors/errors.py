"""Errors that a user of the sensor package can fix."""


class SensorError(Exception):
    """A pattern, sensor file or stored hits cannot be used; the message names the value and the remedy."""

"""The error of the camera package."""

from sensors.errors import SensorError


class CameraError(SensorError):
    """A camera cannot be set up or an image cannot be drawn; the message ends with the remedy."""

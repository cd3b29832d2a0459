"""Grayscale, colour, depth and instance images of pinhole cameras."""

from sensors.cameras.camera import Camera
from sensors.cameras.errors import CameraError
from sensors.cameras.images import Images
from sensors.cameras.light import Light
from sensors.cameras.renderer import CameraRenderer

__all__ = ["Camera", "CameraError", "CameraRenderer", "Images", "Light"]

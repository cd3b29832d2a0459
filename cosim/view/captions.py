"""What the pictures are called and what to look for in them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Caption:
    """Words about one kind of picture.

    Attributes:
        key: ends its file name.
        title: above the picture.
        text: what an engineer should check.
        wide: whether it takes the page's full width.
    """

    key: str
    title: str
    text: str
    wide: bool = False


CAMERA_BOXES = Caption(
    "camera-boxes",
    "Labels in the camera image",
    "3D boxes (thick; the front is crossed) and 2D boxes (thin); gray rectangles are DontCare regions. "
    "Boxes must hug the objects and stand on the ground; occlusion must match what you see.",
    wide=True,
)
CAMERA_DEPTH = Caption(
    "camera-depth",
    "LiDAR points in the camera image",
    "Coloured by depth. Edges of points and pixels must coincide at poles, cars and house corners: "
    "a constant shift is a calibration error, one that grows sideways a timing error.",
    wide=True,
)
PERSPECTIVE_INTENSITY = Caption(
    "perspective-intensity",
    "Scan in perspective, by intensity",
    "From behind and above the vehicle; boxes are the labels. Look for road markings, plates and signs standing "
    "out, walls that are flat, and clean shadows behind objects.",
)
PERSPECTIVE_INSTANCE = Caption(
    "perspective-instance",
    "Scan in perspective, by object",
    "One hue an object, gray the static world. Every point on a car must have its colour, none on the road beneath. "
    "Boxes: all objects hit by at least 5 points, labelled or not.",
)
ABOVE_INTENSITY = Caption(
    "above-intensity",
    "Scan from above, by intensity",
    "Forward is up; rings every 10 m. Labelled boxes with a stroke through the front: "
    "points must line their sides that face the sensor, and headings must follow the lane.",
)
ABOVE_INSTANCE = Caption(
    "above-instance",
    "Scan from above, by object",
    "Outlines of all known objects, named where points hit them; those without points must lie in a shadow "
    "or out of reach. Nothing may overlap.",
)
CLOSE_UPS = Caption(
    "close-ups",
    "Close-ups",
    "The objects with most points, from the sensor's side and above. Wheels, windows, bonnets and limbs should be "
    "readable; points of one object must not be smeared into another.",
    wide=True,
)
RANGE = Caption(
    "range",
    "Range image",
    "A row a ring, a column an azimuth, front in the middle, left on the left; black: no return. Ground must grade "
    "smoothly; rows that stick out are lasers at fault, ragged columns are timing or ordering at fault.",
    wide=True,
)
RANGE_INTENSITY = Caption(
    "range-intensity",
    "Intensity image",
    "The same beams by intensity. Materials must show as areas of even tone; stripes along rows are laser gains.",
    wide=True,
)
DEPTH = Caption(
    "depth",
    "Depth image of camera 0",
    "Must agree in colour with the LiDAR points above; black: nothing within the scale's end.",
    wide=True,
)

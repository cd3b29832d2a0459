"""Titles of the pictures, and what to check in them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Caption:
    """Title and description of a type of picture.

    Attributes:
        key: suffix of the file name.
        title: title above the picture.
        text: what to check in the picture.
        wide: whether the picture has the full width of the page.
    """

    key: str
    title: str
    text: str
    wide: bool = False


CAMERA_BOXES = Caption(
    "camera-boxes",
    "Labels in the camera image",
    "3D boxes (thick, with a cross on the front) and 2D boxes (thin); gray rectangles are DontCare regions. "
    "Boxes must fit the objects closely and be on the ground; the occlusion must match the image.",
    wide=True,
)
CAMERA_DEPTH = Caption(
    "camera-depth",
    "LiDAR points in the camera image",
    "Coloured by depth. Edges in points and image must coincide at poles, cars and house corners: a constant offset is "
    "a calibration error; an offset that increases to one side is a timing error.",
    wide=True,
)
PERSPECTIVE_INTENSITY = Caption(
    "perspective-intensity",
    "Scan in perspective, by intensity",
    "View from behind and above the vehicle; boxes are the labels. Check that road markings, licence plates and signs "
    "are bright, that walls are flat, and that shadows behind objects contain no points.",
)
PERSPECTIVE_INSTANCE = Caption(
    "perspective-instance",
    "Scan in perspective, by object",
    "One colour per object, gray for the static world. All points on a car must have its colour, and no point on the "
    "road below it. Boxes: all objects with at least 5 points, labelled or not.",
)
ABOVE_INTENSITY = Caption(
    "above-intensity",
    "Scan from above, by intensity",
    "Forward is up; rings every 10 m. Labelled boxes have a line through the front. Points must be on the sides that "
    "face the sensor, and headings must follow the lane.",
)
ABOVE_INSTANCE = Caption(
    "above-instance",
    "Scan from above, by object",
    "Outlines of all known objects; objects with points have a name. Objects without points must be hidden or out of "
    "range. Objects must not overlap.",
)
CLOSE_UPS = Caption(
    "close-ups",
    "Close-ups",
    "The objects with the most points, seen from the sensor's side and from above. Wheels, windows, bonnets and limbs "
    "should be recognisable; points of an object must not be assigned to another one.",
    wide=True,
)
RANGE = Caption(
    "range",
    "Range image",
    "One row per ring, one column per azimuth step, the front in the middle, left on the left; black: no return. The "
    "ground must change smoothly. Rows that differ from their neighbours indicate an error of a laser, irregular "
    "columns an error of timing or order.",
    wide=True,
)
RANGE_INTENSITY = Caption(
    "range-intensity",
    "Intensity image",
    "The same beams, coloured by intensity. Each material should have a uniform colour; stripes along rows are "
    "differences in gain between lasers.",
    wide=True,
)
DEPTH = Caption(
    "depth",
    "Depth image of camera 0",
    "The colours must agree with those of the LiDAR points above; black: no surface within the range of the scale.",
    wide=True,
)

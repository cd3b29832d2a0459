"""KITTI's file formats, read and written, and `Drive`, which reads a folder of frames."""

from cosim.drives.kitti.boxes import Boxes, points_in_boxes, wrap_angle
from cosim.drives.kitti.calibration import Calibration, format_calibration, read_calibration, write_calibration
from cosim.drives.kitti.drive import Drive
from cosim.drives.kitti.frame import Frame
from cosim.drives.kitti.image_boxes import box_areas, clip_boxes, project_corners
from cosim.drives.kitti.images import encode_depth, encode_gray, encode_rgb, read_depth, read_image
from cosim.drives.kitti.labels import Labels, format_labels, read_labels, write_labels
from cosim.drives.kitti.oxts import Oxts, format_oxts, read_oxts, write_oxts
from cosim.drives.kitti.points import encode_points, read_points, write_points
from cosim.drives.kitti.rays import PointRays, encode_rays, read_rays, write_rays

__all__ = [
    "Boxes",
    "Calibration",
    "Drive",
    "Frame",
    "Labels",
    "Oxts",
    "PointRays",
    "box_areas",
    "clip_boxes",
    "encode_depth",
    "encode_gray",
    "encode_points",
    "encode_rays",
    "encode_rgb",
    "format_calibration",
    "format_labels",
    "format_oxts",
    "points_in_boxes",
    "project_corners",
    "read_calibration",
    "read_depth",
    "read_image",
    "read_labels",
    "read_oxts",
    "read_points",
    "read_rays",
    "wrap_angle",
    "write_calibration",
    "write_labels",
    "write_oxts",
    "write_points",
    "write_rays",
]

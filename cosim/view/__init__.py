"""Draw the frames of a drive as images, and write a page with them."""

from cosim.view.frame_pictures import Absent, FramePictures, Picture, intensity_scale
from cosim.view.selection import choose_frames, richest_frames
from cosim.view.write import write_view

__all__ = ["Absent", "FramePictures", "Picture", "choose_frames", "intensity_scale", "richest_frames", "write_view"]

"""Twins from labels, without a surveyed world: a ground surface fitted to the points, a model in every labelled box."""

from cosim.labelled_twin.frame_twin import FrameTwin, make_frame_twin
from cosim.labelled_twin.write import TwinSummary, write_labelled_twin

__all__ = ["FrameTwin", "TwinSummary", "make_frame_twin", "write_labelled_twin"]

"""A twin for measurements without a surveyed world: ground fitted to the points, a model in every labelled box."""

from cosim.discrepancy.labelled_twin.frame_twin import FrameTwin, make_frame_twin
from cosim.discrepancy.labelled_twin.trust import Trust, encode_trust, read_trust
from cosim.discrepancy.labelled_twin.write import TwinSummary, write_labelled_twin

__all__ = ["FrameTwin", "Trust", "TwinSummary", "encode_trust", "make_frame_twin", "read_trust", "write_labelled_twin"]

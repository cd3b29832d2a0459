"""Statistics of labelled scans, and how far apart two sets of them are."""

from cosim.stats.compare import Distance, compare_sets
from cosim.stats.frame_set import FrameSet
from cosim.stats.objects import LabelledObjects, difficulty
from cosim.stats.summary import summarise
from cosim.stats.tally import Collected, collect
from cosim.stats.write import as_json, write_stats

__all__ = [
    "Collected",
    "Distance",
    "FrameSet",
    "LabelledObjects",
    "as_json",
    "collect",
    "compare_sets",
    "difficulty",
    "summarise",
    "write_stats",
]

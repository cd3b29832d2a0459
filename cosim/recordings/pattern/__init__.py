"""Estimation of a sensor's beam pattern from its points."""

from cosim.recordings.pattern.find import FoundPattern, find_pattern
from cosim.recordings.pattern.page import format_page

__all__ = ["FoundPattern", "find_pattern", "format_page"]

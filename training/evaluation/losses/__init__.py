"""Losses of average precision by error type and by subset of the objects."""

from training.evaluation.losses.find import SETS_MENDED, Losses, as_json, drawn_frames, find_losses
from training.evaluation.losses.page import format_losses

__all__ = ["SETS_MENDED", "Losses", "as_json", "drawn_frames", "find_losses", "format_losses"]

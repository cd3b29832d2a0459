"""KITTI's object benchmark: 3D, bird's-eye view, 2D and orientation, on the CPU."""

from training.evaluation.evaluate import Evaluation, Result, evaluate
from training.evaluation.read import Scored, pair_frames, read_results

__all__ = ["Evaluation", "Result", "Scored", "evaluate", "pair_frames", "read_results"]

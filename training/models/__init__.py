"""Detectors in plain torch: `pillars_small`, `pointpillars`, `voxel_rcnn`. Needs torch only when one is built."""

from training.models.settings import ModelSettings

__all__ = ["ModelSettings"]

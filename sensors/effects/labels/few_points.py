"""Objects with few points are not labelled."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import LabelEffect, number
from sensors.effects.phases import Phase
from sensors.label_boxes import LabelBoxes


class FewPoints(LabelEffect):
    """Boxes with fewer points than `least_points` become DontCare regions."""

    name: ClassVar = "few_points"
    phase: ClassVar = Phase.FEW_POINTS
    channel: ClassVar = "label"
    equation: ClassVar = "DontCare where points in the box < points"
    reference: ClassVar = "Synth It Like KITTI, arXiv:2502.15076, published code: more than 5 points"
    confusable_with: ClassVar = ("box_shrink",)
    example: ClassVar = {"points": 6}
    neutral: ClassVar = {"points": 0}
    is_candidate: ClassVar = False

    points: float = number("least number of points that make a label", ge=0, le=10_000)

    def apply(self, boxes: LabelBoxes, rng: np.random.Generator) -> LabelBoxes:
        """The boxes, those nearly empty no longer kept."""
        enough = np.array([len(boxes.local_points(row)) >= self.points for row in range(len(boxes))], bool)
        return replace(boxes, kept=boxes.kept & enough)

"""Annotators fit boxes to points, not to vehicles."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from sensors.effects.base import LabelEffect, per_axis
from sensors.effects.phases import Phase
from sensors.label_boxes import LabelBoxes

_VEHICLES = frozenset({"Car", "Van", "Truck", "Misc"})
_LEAST_EDGE_M = 0.1


class BoxShrink(LabelEffect):
    """Each edge of a vehicle's box loses a + b·d, d the edge less the extent of the points in it.

    The box is lifted first, so that the road's points stay outside, and stays lifted. Each of two opposite faces
    gives in proportion to the gap between it and the points: faces that were seen stay where the points are, and
    the far side comes nearer. Boxes without points, and those of people, stay as they are. No edge falls below 0.1 m.
    """

    name: ClassVar = "box_shrink"
    phase: ClassVar = Phase.BOX_SHRINK
    channel: ClassVar = "label"
    equation: ClassVar = "edge − (a + b·d), d = edge − extent of its points"
    reference: ClassVar = "Synth It Like KITTI, arXiv:2502.15076, label bias; lift 0.04 m from its published code"
    confusable_with: ClassVar = ("few_points", "mount_translation", "range_bias")
    example: ClassVar = {"a_m": (0.2, 0.05, 0.05), "b": (0.25, 0.25, 0.05), "lift_m": 0.04}

    a_m: per_axis(0, 2) = Field(  # type: ignore[valid-type]
        description="a, constant loss of length, width and height", json_schema_extra={"unit": "m"}
    )
    b: per_axis(0, 1) = Field(description="b, share of d that length, width and height lose")  # type: ignore[valid-type]
    lift_m: float = Field(
        default=0.04, ge=0, le=0.5, description="how much the box is lifted first", json_schema_extra={"unit": "m"}
    )

    def apply(self, boxes: LabelBoxes, rng: np.random.Generator) -> LabelBoxes:
        """The boxes as an annotator would draw them."""
        centre, size = boxes.centre.copy(), boxes.size.copy()
        for row, kind in enumerate(boxes.kinds):
            points = boxes.local_points(row, self.lift_m) if kind in _VEHICLES else np.empty((0, 3))
            if len(points):
                size[row], move = self._fitted(boxes.size[row], points.min(0), points.max(0))
                cos, sin = np.cos(boxes.yaw[row]), np.sin(boxes.yaw[row])
                centre[row] += [cos * move[0] - sin * move[1], sin * move[0] + cos * move[1], move[2] + self.lift_m]
        return replace(boxes, centre=centre, size=size)

    def _fitted(self, size: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """New edges (3,) and the move of the centre (3,) along them, of a box whose points reach from low to high."""
        behind, before = low + size / 2, size / 2 - high
        spare = behind + before
        loss = np.minimum(np.array(self.a_m) + np.array(self.b) * spare, np.maximum(size - _LEAST_EDGE_M, 0))
        share = np.divide(before, spare, out=np.full(3, 0.5), where=spare > 0)
        return size - loss, loss * (0.5 - share)

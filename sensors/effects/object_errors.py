"""Errors that all objects of a class share: size or position, in the axes of each object.

They belong to the twin and not to the sensor. As an effect they change ranges, so that a model with them fits
measurements of such a twin; the remedy is a twin with other objects.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np

from sensors.effects.base import PointEffect, number
from sensors.effects.phases import Channel
from sensors.normals import decode_normals
from sensors.returns import Returns
from sensors.shot import Shot

GRAZING = 0.05
Lengths = tuple[float, float, float]


class _ObjectError(PointEffect):
    """R + n·Δ/(n·d): the surface that a beam d meets is displaced by Δ, n its normal; |n·d| counts as 0.05 at least.

    Class attributes:
        changes_m: by class of objects, along length, width and height [m].
    """

    channel: ClassVar[Channel] = "range"
    needs_new_rays: ClassVar[bool] = True
    changes_m: ClassVar[Mapping[str, Lengths]] = {}

    amplitude: float = number("size of the effect")

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns with other ranges on objects."""
        return replace(returns, range_m=returns.range_m + (self.amplitude * self.shift_m(returns, shot)).astype("f4"))

    def shift_m(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return the change of range (m,) at amplitude 1; 0 away from objects."""
        found, instances = np.zeros(len(returns)), shot.instances
        rows = np.flatnonzero(returns.instance >= 0)
        if instances is None or not len(rows):
            return found
        on, row = returns.take(rows), returns.instance[rows]
        changes = np.array([self.changes_m.get(kind, (0.0, 0.0, 0.0)) for kind in instances.kinds])[row]
        axes = instances.poses[row, :3, :3]
        moved = instances.velocity_mps[row] * shot.time_s(on)[:, None]
        arm = shot.points_in_world(on) - moved - instances.poses[row, :3, 3]
        within = np.einsum("nji,nj->ni", axes, arm) / np.maximum(instances.sizes[row], 0.1)
        displaced = np.einsum("nij,nj->ni", axes, self._displacement(changes, within))
        normal = decode_normals(on.normal_code).astype(float)
        slope = np.einsum("ij,ij->i", normal, shot.direction_in_world(on).astype(float))
        toward = np.einsum("ij,ij->i", normal, displaced)
        found[rows] = toward * np.sign(slope) / np.maximum(np.abs(slope), GRAZING)
        return found

    def _displacement(self, changes_m: np.ndarray, within: np.ndarray) -> np.ndarray:
        """Displacement (k, 3) [m] in an object's axes.

        Args:
            changes_m: (k, 3) of its class.
            within: (k, 3) positions in shares of its size, from the ground-level centre.
        """
        raise NotImplementedError


class ObjectSizeError(_ObjectError):
    """Objects of a class are longer, wider and higher than in the twin, about their ground-level centres."""

    def _displacement(self, changes_m: np.ndarray, within: np.ndarray) -> np.ndarray:
        return changes_m * within


class ObjectPlaceError(_ObjectError):
    """Objects of a class are farther ahead, left and up in their own axes than in the twin."""

    def _displacement(self, changes_m: np.ndarray, within: np.ndarray) -> np.ndarray:
        return changes_m

"""Positions of the axles and largest steering angles."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

# kind → rear axle behind the front bumper, wheelbase (shares of the length), largest steering angle [degrees]
_BUILD = {
    "car": (0.79, 0.60, 36.0),
    "van": (0.78, 0.60, 38.0),
    "truck": (0.74, 0.55, 45.0),
    "bus": (0.73, 0.49, 50.0),
    "tram": (0.773, 0.546, 30.0),
    "motorcycle": (0.84, 0.66, 40.0),
    "cyclist": (0.81, 0.60, 50.0),
    "pedestrian": (0.50, 0.60, 50.0),
}
_LONG_M = 5.6
_WHEEL_RATE_RADPS = 0.9  # quick hands: about 50 degrees of the front wheels a second


@dataclass(frozen=True, eq=False)
class Chassis:
    """Parameters of a rear-axle bicycle model of n vehicles.

    Attributes:
        rear_m: (n,) rear axle behind the front bumper.
        guide_m: (n,) point that follows the lane behind the front bumper: the bumper itself, but for long vehicles the
            position from which front and rear leave the lane symmetrically, so that they swing out before they cut in.
        length_m: (n,).
        max_curvature_per_m: (n,) of the rear axle's path.
        max_curvature_rate_per_ms: (n,) how fast it changes.
        on_rails: (n,) bool, both axles (bogies) stay on the guiding line.
    """

    rear_m: np.ndarray
    guide_m: np.ndarray
    length_m: np.ndarray
    max_curvature_per_m: np.ndarray
    max_curvature_rate_per_ms: np.ndarray
    on_rails: np.ndarray

    def take(self, rows: np.ndarray) -> Chassis:
        """Those of some rows."""
        return Chassis(*(getattr(self, field.name)[rows] for field in fields(self)))

    @classmethod
    def of(cls, types: tuple[str, ...], length_m: np.ndarray) -> Chassis:
        """The chassis of vehicles of given kinds and lengths (n,)."""
        build = np.array([_BUILD[kind] for kind in types], float).reshape(-1, 3)
        wheelbase = build[:, 1] * length_m
        return cls(
            rear_m=build[:, 0] * length_m,
            guide_m=np.where(length_m > _LONG_M, (1 - np.sqrt(0.5)) * build[:, 0] * length_m, 0.0),
            length_m=np.asarray(length_m, float),
            max_curvature_per_m=np.tan(np.radians(build[:, 2])) / wheelbase,
            max_curvature_rate_per_ms=_WHEEL_RATE_RADPS / wheelbase,
            on_rails=np.array([kind == "tram" for kind in types], bool),
        )

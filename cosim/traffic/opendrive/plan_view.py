"""Reference line of an OpenDRIVE road in the plane: lines, arcs, spirals and cubic polynomials.

ASAM OpenDRIVE 1.8, 9 (geometry): each element starts at its own position and heading; s counts along the line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
_TABLE = 513  # points of a table of arc lengths

Curve = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""From distances along an element (n,) [m] to u, v [m] and heading [rad], each (n,), about its start."""


def line() -> Curve:
    """A straight line."""
    return lambda ds: (ds, np.zeros_like(ds), np.zeros_like(ds))


def spiral(start_per_m: float, end_per_m: float, length_m: float) -> Curve:
    """A clothoid, whose curvature changes linearly from start to end [1/m]; an arc if both are equal.

    Positions are integrals of the heading by Gauss-Legendre quadrature.
    """
    rate = (end_per_m - start_per_m) / length_m if length_m > 0 else 0.0

    def curve(ds: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        along = ds[:, None] * (_NODES + 1) / 2
        turned = start_per_m * along + rate / 2 * along**2
        u, v = (ds / 2 * (part(turned) @ _WEIGHTS) for part in (np.cos, np.sin))
        return u, v, start_per_m * ds + rate / 2 * ds**2

    return curve


def clothoid(
    x_m: float, y_m: float, heading_rad: float, curvature_per_m: float, rate_per_m2: float, along_m: np.ndarray
) -> np.ndarray:
    """x, y [m] and heading [rad] (n, 3) at distances (n,) along a clothoid with a start and its curvature."""
    length_m = float(along_m.max())
    curve = spiral(curvature_per_m, curvature_per_m + rate_per_m2 * length_m, length_m)
    return PlanView(np.zeros(1), np.array([[x_m, y_m, heading_rad]]), (curve,)).at(along_m)


def polynomial(u: Sequence[float], v: Sequence[float], end: float, length_m: float | None) -> Curve:
    """A curve with cubic polynomials u(p) and v(p) as coordinates.

    Args:
        u: coefficients, the constant first.
        v: likewise.
        end: value of p at the end.
        length_m: length of the element if p is no length; p is then found by the arc length, scaled so that the
            element ends at `end`. None if p is the distance itself.
    """
    along_u, along_v = (np.polynomial.Polynomial(each) for each in (u, v))
    slope_u, slope_v = along_u.deriv(), along_v.deriv()
    table_p = np.linspace(0, end, _TABLE)
    speed = np.hypot(slope_u(table_p), slope_v(table_p))
    arc = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(table_p))])

    def curve(ds: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        p = ds if length_m is None else np.interp(ds * (arc[-1] / length_m if length_m > 0 else 1.0), arc, table_p)
        return along_u(p), along_v(p), np.arctan2(slope_v(p), slope_u(p))

    return curve


def explicit_cubic(v: Sequence[float], length_m: float) -> Curve:
    """The element `poly3`: v as a cubic polynomial of u, as far as its arc length reaches."""
    slope = np.polynomial.Polynomial(v).deriv()
    table_u = np.linspace(0, length_m, _TABLE)
    speed = np.hypot(1.0, slope(table_u))
    arc = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(table_u))])
    end = float(np.interp(length_m, arc, table_u))
    return polynomial([0.0, 1.0], v, end, length_m)


@dataclass(frozen=True, eq=False)
class PlanView:
    """Reference line of a road, an element after the other.

    Attributes:
        start_s: (k,) s at which each element starts [m].
        start: (k, 3) x, y [m] and heading [rad] there, counter-clockwise from x.
        curves: of each element.
    """

    start_s: np.ndarray
    start: np.ndarray
    curves: tuple[Curve, ...]

    def at(self, s_m: np.ndarray) -> np.ndarray:
        """x, y [m] and heading [rad] (n, 3) at distances along the line (n,)."""
        element = np.clip(np.searchsorted(self.start_s, s_m, side="right") - 1, 0, len(self.curves) - 1)
        found = np.empty((len(s_m), 3))
        for number in np.unique(element):
            rows = element == number
            u, v, turned = self.curves[number](s_m[rows] - self.start_s[number])
            x, y, heading = self.start[number]
            cosine, sine = np.cos(heading), np.sin(heading)
            found[rows] = np.column_stack([x + u * cosine - v * sine, y + u * sine + v * cosine, heading + turned])
        return found

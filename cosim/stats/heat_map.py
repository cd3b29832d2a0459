"""Heat maps of car positions: density from above and from the side, and the difference of two sets."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cosim.drives.kitti import encode_rgb
from cosim.report.plot import Axis, Plot
from cosim.stats.objects import LabelledObjects

_ZOOM = 4  # picture pixels a cell
_MANY_CARS = 3000  # more need no wider smoothing than a cell
_GROUND_RGB = np.array([13, 16, 22], float)
_RAMP = np.array([[13, 16, 22], [44, 32, 92], [130, 38, 110], [212, 72, 66], [252, 156, 40], [252, 246, 180]], float)
_LESS, _MORE = np.array([90, 169, 255], float), np.array([255, 178, 62], float)


@dataclass(frozen=True)
class HeatMapView:
    """A plane that cars are seen in.

    Attributes:
        key: `birds_eye` or `side_view`.
        x, y: axes, metres.
        cell: size of a cell along both.
        size: of the plot [px].
    """

    key: str
    x: Axis
    y: Axis
    cell: tuple[float, float]
    size: tuple[int, int]

    def density(self, cars: LabelledObjects, smooth_cells: float) -> np.ndarray:
        """(rows, columns) float64 share of the cars in each cell, blurred by a Gaussian; top row first."""
        u, v = self._coordinates(cars)
        columns, rows = (
            round((axis.high - axis.low) / step) for axis, step in zip((self.x, self.y), self.cell, strict=True)
        )
        counts, _, _ = np.histogram2d(v, u, (rows, columns), ((self.y.low, self.y.high), (self.x.low, self.x.high)))
        smooth = cv2.GaussianBlur(counts, (0, 0), smooth_cells, borderType=cv2.BORDER_CONSTANT)
        return smooth[::-1] / max(len(cars), 1)

    def outside(self, cars: LabelledObjects) -> float:
        """Share of the cars that lie outside the plane's bounds."""
        u, v = self._coordinates(cars)
        inside = (u >= self.x.low) & (u <= self.x.high) & (v >= self.y.low) & (v <= self.y.high)
        return float(1 - inside.mean()) if len(cars) else 0.0

    def plot(self, colours: np.ndarray, title: str) -> Plot:
        """The picture in its axes."""
        plot = Plot(self.x, self.y, title, *self.size)
        large = cv2.resize(colours, None, fx=_ZOOM, fy=_ZOOM, interpolation=cv2.INTER_CUBIC)
        image = np.clip(np.rint(large), 0, 255).astype(np.uint8)
        plot.picture(encode_rgb(image), self.x.low, self.x.high, self.y.low, self.y.high)
        return plot

    def _coordinates(self, cars: LabelledObjects) -> tuple[np.ndarray, np.ndarray]:
        if self.key == "birds_eye":
            return -cars.centre[:, 1], cars.centre[:, 0]
        return cars.distance_m, cars.centre[:, 2]


VIEWS = (
    HeatMapView("birds_eye", Axis(-40, 40, "to the right (m)"), Axis(0, 80, "ahead (m)"), (1.0, 1.0), (560, 548)),
    HeatMapView(
        "side_view", Axis(0, 80, "distance (m)"), Axis(-3, 2, "height above the sensor (m)"), (1.0, 0.1), (560, 340)
    ),
)


def smoothing_cells(cars: int) -> float:
    """Standard deviation of the blur in cells: wider where there are few cars, as the fourth root of their number."""
    return float(np.clip((_MANY_CARS / max(cars, 1)) ** 0.25, 1.0, 2.5))


def density_colours(density: np.ndarray, top: float) -> np.ndarray:
    """(rows, columns, 3) float64 colours, brighter with the square root of density; `top` is the brightest."""
    share = np.sqrt(np.clip(density / top, 0, 1)) * (len(_RAMP) - 1)
    return np.stack([np.interp(share, np.arange(len(_RAMP)), _RAMP[:, channel]) for channel in range(3)], -1)


def difference_colours(a: np.ndarray, b: np.ndarray, top: float) -> np.ndarray:
    """(rows, columns, 3) float64: orange where `a` has more, blue where `b` has."""
    share = np.sign(a - b) * np.sqrt(np.clip(np.abs(a - b) / top, 0, 1))
    tint = np.where(share[..., None] > 0, _MORE, _LESS)
    return _GROUND_RGB + (tint - _GROUND_RGB) * np.abs(share)[..., None]

"""The smooth ground surface of a town, fitted to the heights of the lanes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solveh_banded
from scipy.sparse import coo_array, csr_array, eye_array, kron

from assets.streets import Streets

_SAMPLE_M = 3.0
_BENDING = 2e-3  # weight of curvature against a lane sample: keeps the fit calm between streets
_SLOPE = 2e-5  # weight of slope: levels the ground far away from any street


@dataclass(frozen=True, eq=False)
class HeightField:
    """A uniform cubic B-spline surface z = H(x, y).

    Attributes:
        origin_m: (2,) x, y of the first control point.
        spacing_m: distance of control points.
        control: (nx, ny) float64 control heights, metres.
    """

    origin_m: np.ndarray
    spacing_m: float
    control: np.ndarray

    def __call__(self, xy: np.ndarray) -> np.ndarray:
        """Heights (n,) float64 in metres at world points `xy` (n, 2); beyond the edge the edge's height."""
        from scipy.ndimage import map_coordinates

        uv = (np.asarray(xy, np.float64).reshape(-1, 2) - self.origin_m) / self.spacing_m
        return map_coordinates(self.control, uv.T, order=3, mode="nearest", prefilter=False)


def fit_height_field(streets: Streets, low: np.ndarray, high: np.ndarray, spacing_m: float = 8.0) -> HeightField:
    """Fits a penalised B-spline (P-spline: Eilers & Marx 1996) to all lane centre lines.

    Args:
        streets: the lanes, with heights.
        low, high: (2,) corners of the area to cover, world metres.
        spacing_m: distance of control points.
    """
    samples = np.concatenate([_resample(lane.centre) for lane in streets.lanes])
    origin = low - spacing_m
    shape = tuple(int(n) for n in np.ceil((high + spacing_m - origin) / spacing_m) + 1)
    basis = _basis((samples[:, :2] - origin) / spacing_m, shape)
    level = float(samples[:, 2].mean())
    normal = basis.T @ basis + _penalty(shape)
    control = solveh_banded(
        _lower_band(csr_array(normal), shape[0] * shape[1]), basis.T @ (samples[:, 2] - level), lower=True
    )
    control = np.round(control + level, 6)  # the solver's last bits depend on its number of threads
    return HeightField(origin, spacing_m, control.reshape(shape))


def _resample(line: np.ndarray) -> np.ndarray:
    """Points every ~3 m along a polyline (k, 3)."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line[:, :2], axis=0), axis=1))])
    stations = np.linspace(0.0, along[-1], max(2, int(along[-1] / _SAMPLE_M) + 1))
    return np.stack([np.interp(stations, along, line[:, k]) for k in range(3)], axis=1)


def _basis(uv: np.ndarray, shape: tuple[int, ...]) -> csr_array:
    """Sparse matrix (n, nx·ny) that evaluates the spline at control-grid coordinates `uv` (n, 2)."""
    cell = np.floor(uv).astype(int)
    t = uv - cell
    weight = np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]) / 6
    node = np.clip(cell[None] + np.arange(-1, 3)[:, None, None], 0, np.array(shape) - 1)
    row = np.broadcast_to(np.arange(len(uv)), (4, 4, len(uv)))
    column = node[:, None, :, 0] * shape[1] + node[None, :, :, 1]
    value = weight[:, None, :, 0] * weight[None, :, :, 1]
    return coo_array((value.ravel(), (row.ravel(), column.ravel())), shape=(len(uv), shape[0] * shape[1])).tocsr()


def _penalty(shape: tuple[int, ...]) -> csr_array:
    """Bending energy (∂xx² + 2∂xy² + ∂yy²) and slope of the control net."""
    slope = [_difference(n, (-1.0, 1.0)) for n in shape]
    bend = [_difference(n, (1.0, -2.0, 1.0)) for n in shape]
    unit = [eye_array(n) for n in shape]
    terms = (
        (_BENDING, kron(bend[0], unit[1])),
        (2 * _BENDING, kron(slope[0], slope[1])),
        (_BENDING, kron(unit[0], bend[1])),
        (_SLOPE, kron(slope[0], unit[1])),
        (_SLOPE, kron(unit[0], slope[1])),
    )
    count = shape[0] * shape[1]
    total = csr_array((count, count))
    for weight, term in terms:
        total = total + weight * (term.T @ term)
    return csr_array(total)


def _difference(count: int, stencil: tuple[float, ...]) -> csr_array:
    """Finite differences of `count` equally spaced values."""
    rows = count - len(stencil) + 1
    total = csr_array((rows, count))
    for k, value in enumerate(stencil):
        total = total + value * eye_array(rows, count, k=k)
    return csr_array(total)


def _lower_band(matrix: csr_array, count: int) -> np.ndarray:
    """LAPACK's lower banded storage of a symmetric sparse matrix."""
    entries = matrix.tocoo()
    keep = entries.row >= entries.col
    row, column, value = entries.row[keep], entries.col[keep], entries.data[keep]
    band = np.zeros((int((row - column).max()) + 1, count))
    np.add.at(band, (row - column, column), value)
    return band

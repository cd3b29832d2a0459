"""Fit a smooth ground surface to one scan without absorbing the errors of the sensor.

The ground is fitted as

    z = u(x, y) + s(x, y) − ρ·tan δ

u is linear along the direction of travel and a polynomial across it, like a road: 1, x, y, y², y³, y⁴, x·y, x·y².
s is a smooth remainder with a penalty on its curvature. The penalty has a length scale L that increases with distance,
so that L spans several rings. ρ·tan δ is the cone into which a constant elevation error of all lasers turns flat
ground. The cone is fitted together with u, but it is **not part of the surface**: a twin that contained it would hide
the elevation error. Hills also cause cones, with varying sign; the cone of the sensor is the same in all frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix, diags, kron, vstack
from scipy.sparse import eye as identity
from scipy.sparse.linalg import spsolve

from cosim.labelled_twin.road_cells import RoadCells

REACH_M = 30.0
SIDE_M = 14.0
_NODE_M = 1.0
_LENGTH_M = 1.0  # L near the sensor: a wave of length 2π·L = 6 m is damped to half
_RINGS = 0.8  # L relative to the gap between rings: waves shorter than five gaps are suppressed
_RING_GAP_PER_M2 = 0.0052  # gap between rings on the ground over squared distance (0.5° spacing at 1.7 m height)
_MIN_CELLS = 200
_CONE_LEVER_M = 2.0  # minimum rms of the part of ρ orthogonal to u; below it, cone and slope are confounded
_TUKEY, _MIN_WIDTH_M = 4.7, 0.03
_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class GroundSurface:
    """Ground surface of one scan in LiDAR axes.

    Attributes:
        road: (8,) coefficients of u.
        cone_rad: δ, positive if distant ground is measured too low [rad].
        lever_m: rms of the part of ρ orthogonal to u; large values mean that the cone is well determined [m].
        corner_m: (2,) x, y of the first node of s [m].
        remainder_m: (k, m) float64, s at nodes one metre apart, x along the first axis [m].
    """

    road: np.ndarray
    cone_rad: float
    lever_m: float
    corner_m: np.ndarray
    remainder_m: np.ndarray

    @property
    def knows_cone(self) -> bool:
        """Whether the cone is observable, because the scan contains road in front of and behind the sensor."""
        return self.lever_m >= _CONE_LEVER_M

    def height(self, xy: np.ndarray) -> np.ndarray:
        """z of the surface (n,) [m] at positions (n, 2); outside the nodes that of the nearest node edge."""
        xy = np.asarray(xy, np.float64)
        weights = _interpolation(xy, self.corner_m, self.remainder_m.shape)
        return _road_terms(xy) @ self.road + weights @ self.remainder_m.reshape(-1)

    def fitted(self, xy: np.ndarray) -> np.ndarray:
        """z of the surface with the cone (n,) [m], the function that was fitted to the points."""
        return self.height(xy) - np.hypot(xy[:, 0], xy[:, 1]) * np.tan(self.cone_rad)


def fit_ground(cells: RoadCells) -> tuple[GroundSurface, RoadCells] | None:
    """Fit the surface; returns it with the cells within its bounds, or None if there are too few cells."""
    cells = cells.take((cells.reach_m < REACH_M) & (np.abs(cells.xyz[:, 1]) < SIDE_M))
    if len(cells) < _MIN_CELLS:
        return None
    xy, z, reach = cells.xyz[:, :2], cells.xyz[:, 2], cells.reach_m
    terms = _road_terms(xy)
    design = np.column_stack([terms, -reach])
    prior = np.sqrt(cells.area_m2)
    lever = _lever(terms, reach, prior)
    if lever < _CONE_LEVER_M:
        design[:, -1] = 0  # confounded with the slope: fit without a cone
    corner, shape = _nodes(xy)
    at_nodes = _interpolation(xy, corner, shape)
    solution, residual = _fit_robust(design, z, prior)
    remainder = _fit_smooth(at_nodes, residual, prior, _bending_energy(corner, shape))
    cone = float(np.arctan(solution[-1]))
    return GroundSurface(solution[:-1], cone, lever, corner, remainder.reshape(shape)), cells


def _fit_robust(design: np.ndarray, z: np.ndarray, prior: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and residuals of a linear fit with Tukey's biweight."""
    weight, solution = np.ones_like(z), np.zeros(design.shape[1])
    for _ in range(_ROUNDS):
        root = prior * weight
        solution = np.linalg.lstsq(design * root[:, None], z * root, rcond=1e-9)[0]
        weight = _tukey(z - design @ solution)
    return solution, z - design @ solution


def _fit_smooth(at_nodes: csr_matrix, residual: np.ndarray, prior: np.ndarray, bending: csr_matrix) -> np.ndarray:
    """Node heights of a smoothing surface through the residuals, with Tukey's biweight."""
    columns = bending.get_shape()[1]
    weight, nodes = np.ones_like(residual), np.zeros(columns)
    for _ in range(_ROUNDS // 2):
        scaled = diags((prior * weight) ** 2) @ at_nodes
        nodes = np.asarray(spsolve((at_nodes.T @ scaled + bending).tocsc(), scaled.T @ residual))
        weight = _tukey(residual - at_nodes @ nodes)
    return nodes


def _tukey(residual: np.ndarray) -> np.ndarray:
    width = max(_TUKEY * 1.48 * float(np.median(np.abs(residual))), _MIN_WIDTH_M)
    return np.clip(1 - (residual / width) ** 2, 0, None)


def _road_terms(xy: np.ndarray) -> np.ndarray:
    """Values of the eight terms of u, (n, 8), scaled to similar magnitudes."""
    x, y = xy[:, 0] / REACH_M, xy[:, 1] / SIDE_M
    return np.column_stack([np.ones_like(x), x, y, y**2, y**3, y**4, x * y, x * y**2])


def _lever(terms: np.ndarray, reach: np.ndarray, prior: np.ndarray) -> float:
    solution = np.linalg.lstsq(terms * prior[:, None], reach * prior, rcond=1e-9)[0]
    return float(np.sqrt(np.average((reach - terms @ solution) ** 2, weights=prior**2)))


def _nodes(xy: np.ndarray) -> tuple[np.ndarray, tuple[int, int]]:
    corner = np.floor(xy.min(0) / _NODE_M) * _NODE_M
    count = np.ceil((xy.max(0) - corner) / _NODE_M).astype(int) + 1
    return corner, (max(int(count[0]), 3), max(int(count[1]), 3))


def _interpolation(xy: np.ndarray, corner: np.ndarray, shape: tuple[int, int]) -> csr_matrix:
    """Bilinear weights (n, nodes) of the nodes at positions (n, 2); outside the nodes those of the nearest edge."""
    position = np.clip((xy - corner) / _NODE_M, 0, np.array(shape) - 1 - 1e-9)
    index = position.astype(int)
    (i, j), (a, b) = index.T, (position - index).T
    rows = np.tile(np.arange(len(xy)), 4)
    columns = np.concatenate([(i + di) * shape[1] + j + dj for di in (0, 1) for dj in (0, 1)])
    values = np.concatenate([(1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b])
    return csr_matrix((values, (rows, columns)), shape=(len(xy), shape[0] * shape[1]))


def _bending_energy(corner: np.ndarray, shape: tuple[int, int]) -> csr_matrix:
    """∫ L⁴·(s_xx² + 2·s_xy² + s_yy²) as a quadratic form of the nodes."""
    x, y = (corner[axis] + _NODE_M * np.arange(shape[axis]) for axis in (0, 1))
    reach = np.hypot(x[:, None], y[None, :])
    length = np.maximum(_LENGTH_M, _RINGS * _RING_GAP_PER_M2 * reach**2)
    stiffness = length**4 * _NODE_M**2 / _NODE_M**4
    terms = []
    for over_x, over_y, factor in ((2, 0, 1.0), (1, 1, 2.0), (0, 2, 1.0)):
        form = kron(_difference(shape[0], over_x), _difference(shape[1], over_y))
        local = stiffness[over_x // 2 : shape[0] - (over_x + 1) // 2, over_y // 2 : shape[1] - (over_y + 1) // 2]
        terms.append(diags(np.sqrt(factor * local.reshape(-1))) @ form)
    operator = vstack(terms)
    return csr_matrix(operator.T @ operator + 1e-6 * identity(shape[0] * shape[1]))


def _difference(count: int, order: int) -> csr_matrix:
    stencil = {0: [1.0], 1: [-1.0, 1.0], 2: [1.0, -2.0, 1.0]}[order]
    rows = np.arange(count - order)
    filled = [
        csr_matrix((np.full(len(rows), value), (rows, rows + k)), (len(rows), count)) for k, value in enumerate(stencil)
    ]
    return csr_matrix(sum(filled[1:], filled[0]))

"""A smooth surface through the ground of one scan that leaves the sensor's own errors where they are.

The ground is fitted as

    z = u(x, y) + s(x, y) − ρ·tan δ

u is straight along the direction of travel and curved across it, as roads are: 1, x, y, y², y³, y⁴, x·y, x·y².
s is a smooth remainder, whose bending over lengths L costs as much as missing the points: L grows with distance so
that it spans several rings. ρ·tan δ is the cone that a constant error of all elevations makes of flat ground. It is
fitted beside the others and then **left out of the surface**: a twin that contained it would hide that error. Hills
make cones too, of either sign from place to place; the sensor's is the same everywhere, which is how it is told apart.
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
_LENGTH_M = 1.0  # of the remainder near by: half of a wave of 2π·L = 6 m passes
_RINGS = 0.8  # of the gap between rings: farther off waves shorter than five gaps are left out
_RING_GAP_PER_M2 = 0.0052  # spacing of rings on the ground is this times the distance squared (0.5° at 1.7 m)
_FEWEST_CELLS = 200
_CONE_LEVER_M = 2.0  # rms of ρ that u cannot imitate; with less, cone and slope look alike
_TUKEY, _FINEST_M = 4.7, 0.03
_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class GroundSurface:
    """The ground of one scan, LiDAR axes.

    Attributes:
        road: (8,) coefficients of u.
        cone_rad: δ: positive where distant ground is reported too low.
        lever_m: rms of the part of ρ that u cannot imitate; tells how well the cone is known.
        corner_m: (2,) x, y of the first node of s.
        remainder_m: (k, m) float64, s at nodes one metre apart, x along the first axis.
    """

    road: np.ndarray
    cone_rad: float
    lever_m: float
    corner_m: np.ndarray
    remainder_m: np.ndarray

    @property
    def knows_cone(self) -> bool:
        """Whether the scan shows road ahead and behind, so that a cone is no slope."""
        return self.lever_m >= _CONE_LEVER_M

    def height(self, xy: np.ndarray) -> np.ndarray:
        """z of the surface [m], (n,), at places (n, 2); of its nearest place outside the nodes."""
        xy = np.asarray(xy, np.float64)
        weights = _interpolation(xy, self.corner_m, self.remainder_m.shape)
        return _road_terms(xy) @ self.road + weights @ self.remainder_m.reshape(-1)

    def fitted(self, xy: np.ndarray) -> np.ndarray:
        """z with the cone, (n,): what the points were fitted with."""
        return self.height(xy) - np.hypot(xy[:, 0], xy[:, 1]) * np.tan(self.cone_rad)


def fit_ground(cells: RoadCells) -> tuple[GroundSurface, RoadCells] | None:
    """The surface and the cells within its bounds; None with too few of them."""
    cells = cells.take((cells.reach_m < REACH_M) & (np.abs(cells.xyz[:, 1]) < SIDE_M))
    if len(cells) < _FEWEST_CELLS:
        return None
    xy, z, reach = cells.xyz[:, :2], cells.xyz[:, 2], cells.reach_m
    terms = _road_terms(xy)
    design = np.column_stack([terms, -reach])
    prior = np.sqrt(cells.area_m2)
    lever = _lever(terms, reach, prior)
    if lever < _CONE_LEVER_M:
        design[:, -1] = 0  # not to be told from a slope: taken as one
    corner, shape = _nodes(xy)
    at_nodes = _interpolation(xy, corner, shape)
    solution, left = _robust_fit(design, z, prior)
    remainder = _smooth(at_nodes, left, prior, _bending(corner, shape))
    cone = float(np.arctan(solution[-1]))
    return GroundSurface(solution[:-1], cone, lever, corner, remainder.reshape(shape)), cells


def _robust_fit(design: np.ndarray, z: np.ndarray, prior: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients and residuals of a linear fit with Tukey's weights."""
    weight, solution = np.ones_like(z), np.zeros(design.shape[1])
    for _ in range(_ROUNDS):
        root = prior * weight
        solution = np.linalg.lstsq(design * root[:, None], z * root, rcond=1e-9)[0]
        weight = _tukey(z - design @ solution)
    return solution, z - design @ solution


def _smooth(at_nodes: csr_matrix, left: np.ndarray, prior: np.ndarray, bending: csr_matrix) -> np.ndarray:
    """Heights of the nodes that bend little and pass near what is left, with Tukey's weights."""
    columns = bending.get_shape()[1]
    weight, nodes = np.ones_like(left), np.zeros(columns)
    for _ in range(_ROUNDS // 2):
        scaled = diags((prior * weight) ** 2) @ at_nodes
        nodes = np.asarray(spsolve((at_nodes.T @ scaled + bending).tocsc(), scaled.T @ left))
        weight = _tukey(left - at_nodes @ nodes)
    return nodes


def _tukey(left: np.ndarray) -> np.ndarray:
    width = max(_TUKEY * 1.48 * float(np.median(np.abs(left))), _FINEST_M)
    return np.clip(1 - (left / width) ** 2, 0, None)


def _road_terms(xy: np.ndarray) -> np.ndarray:
    """Values of the eight terms of u, (n, 8), scaled to be of about one size."""
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
    """Bilinear weights of the nodes at places (n, 2), (n, nodes); beyond the nodes, of the nearest edge."""
    place = np.clip((xy - corner) / _NODE_M, 0, np.array(shape) - 1 - 1e-9)
    whole = place.astype(int)
    (i, j), (a, b) = whole.T, (place - whole).T
    rows = np.tile(np.arange(len(xy)), 4)
    columns = np.concatenate([(i + di) * shape[1] + j + dj for di in (0, 1) for dj in (0, 1)])
    values = np.concatenate([(1 - a) * (1 - b), (1 - a) * b, a * (1 - b), a * b])
    return csr_matrix((values, (rows, columns)), shape=(len(xy), shape[0] * shape[1]))


def _bending(corner: np.ndarray, shape: tuple[int, int]) -> csr_matrix:
    """∫ L⁴·(s_xx² + 2·s_xy² + s_yy²) as a quadratic form of the nodes."""
    x, y = (corner[axis] + _NODE_M * np.arange(shape[axis]) for axis in (0, 1))
    reach = np.hypot(x[:, None], y[None, :])
    length = np.maximum(_LENGTH_M, _RINGS * _RING_GAP_PER_M2 * reach**2)
    stiff = length**4 * _NODE_M**2 / _NODE_M**4
    bends = []
    for over_x, over_y, factor in ((2, 0, 1.0), (1, 1, 2.0), (0, 2, 1.0)):
        form = kron(_difference(shape[0], over_x), _difference(shape[1], over_y))
        at = stiff[over_x // 2 : shape[0] - (over_x + 1) // 2, over_y // 2 : shape[1] - (over_y + 1) // 2]
        bends.append(diags(np.sqrt(factor * at.reshape(-1))) @ form)
    bend = vstack(bends)
    return csr_matrix(bend.T @ bend + 1e-6 * identity(shape[0] * shape[1]))


def _difference(count: int, order: int) -> csr_matrix:
    stencil = {0: [1.0], 1: [-1.0, 1.0], 2: [1.0, -2.0, 1.0]}[order]
    rows = np.arange(count - order)
    filled = [
        csr_matrix((np.full(len(rows), value), (rows, rows + k)), (len(rows), count)) for k, value in enumerate(stencil)
    ]
    return csr_matrix(sum(filled[1:], filled[0]))

"""Tall static objects displaced from the map: buildings, poles, trees, hedges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import csgraph

from tests.hidden.glb_edit import move_vertices, read_triangles

_TALL_M, _WIDEST_M = 2.0, 60.0  # what is higher and no wider is a thing, not ground
_FOOT_M = 0.3  # small parts below this height above the thing's foot are the ground around it
_CELL_M = 0.25
_SHARE = 0.2
_SHIFT_M = (0.02, 0.05)
_KEYS_PER_M = 500  # vertices nearer than 2 mm are one


def move_tall_things(source: Path, target: Path, rng: np.random.Generator) -> None:
    """Copy a map with a fifth of its tall things moved sideways by 2–5 cm, each as a whole.

    A thing is all that touches in the plan: walls with their windows, a trunk with its leaves.
    """
    points, triangles = read_triangles(source)
    key = _keys(points)
    thing = _things(points, triangles, key)
    shift = np.zeros((thing.max() + 2, 3))  # the last row is for what belongs to nothing
    moved = np.flatnonzero(rng.random(thing.max() + 1) < _SHARE)
    heading, length = rng.uniform(0, 2 * np.pi, len(moved)), rng.uniform(*_SHIFT_M, len(moved))
    shift[moved] = np.column_stack([np.cos(heading), np.zeros(len(moved)), np.sin(heading)]) * length[:, None]
    known, first = np.unique(key, return_index=True)

    def of(vertices: np.ndarray) -> np.ndarray:
        return shift[thing[first[np.searchsorted(known, _keys(vertices))]]]

    move_vertices(source, target, of)


def _things(points: np.ndarray, triangles: np.ndarray, key: np.ndarray) -> np.ndarray:
    """(n,) number of the thing that each vertex belongs to, −1 for none."""
    part = _connected(triangles, key)
    count = part.max() + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, part, points)
    np.maximum.at(high, part, points)
    size = high - low
    tall = (size[:, 1] > _TALL_M) & (np.hypot(size[:, 0], size[:, 2]) < _WIDEST_M)
    origin = low.min(0)
    cell_low, cell_high = (((ends - origin) / _CELL_M).astype(int)[:, [0, 2]] for ends in (low, high))
    plan = np.zeros(cell_high.max(0) + 1, bool)
    for row in np.flatnonzero(tall):
        (x0, y0), (x1, y1) = cell_low[row], cell_high[row]
        plan[x0 : x1 + 1, y0 : y1 + 1] = True
    label = np.zeros(plan.shape, np.int32)
    things = int(ndimage.label(plan, output=label))  # pyright: ignore[reportArgumentType]
    middle = (cell_low + cell_high) // 2
    of_part = label[middle[:, 0], middle[:, 1]] - 1
    foot = np.full(things + 1, np.inf)
    np.minimum.at(foot, of_part[tall], low[tall, 1])
    small = ~tall & (np.hypot(size[:, 0], size[:, 2]) < _WIDEST_M) & (low[:, 1] > foot[of_part] + _FOOT_M)
    return np.where(tall | small, of_part, -1)[part]


def _connected(triangles: np.ndarray, key: np.ndarray) -> np.ndarray:
    """(n,) number of the connected part of each vertex; vertices at one place are one."""
    _, node = np.unique(key, return_inverse=True)
    one, other = node[triangles[:, [0, 1]]].T, node[triangles[:, [1, 2]]].T
    ends = np.concatenate([one[0], other[0]]), np.concatenate([one[1], other[1]])
    links = sparse.coo_matrix((np.ones(len(ends[0]), bool), ends), (node.max() + 1,) * 2)
    part: np.ndarray = csgraph.connected_components(links, directed=False)[1]
    return part[node]


def _keys(points: np.ndarray) -> np.ndarray:
    """(n,) int64, one a place; 21 bits an axis reach ± 2 km."""
    cells = np.round(np.asarray(points, np.float32).astype(float) * _KEYS_PER_M).astype(np.int64) + (1 << 20)
    return (cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2]

"""Faces of closed surfaces, whose inner sides are not visible from outside."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh

_BLOCK = 1 << 16  # faces that are processed at once


def closed_faces(mesh: Mesh) -> np.ndarray:
    """True for faces of closed, outward-facing pieces, (m,) bool: their back may be left undrawn.

    A piece is a set of faces connected by edges between equal positions. It is closed if every edge is run as
    often one way as the other, and faces outward if its signed volume is positive. A ray from outside then
    meets a front face first, so leaving out the back faces changes no pixel.
    """
    if not len(mesh.faces):
        return np.zeros(0, bool)
    corners = _welded(mesh)
    edge, flow = _edges(corners)
    piece = _pieces(edge)
    n_pieces = piece.max() + 1

    balance = np.bincount(edge.ravel(), flow.ravel())
    leaky = (balance[edge] != 0).any(1)
    closed = np.bincount(piece, leaky, n_pieces) == 0
    return (closed & (_volumes(mesh, piece, n_pieces) > 0))[piece]


def _welded(mesh: Mesh) -> np.ndarray:
    """Faces (m, 3) over positions instead of vertices."""
    x, y, z = (mesh.vertices + np.float32(0)).T.view(np.uint32)  # + 0 turns −0 into 0
    return _number(_number(x, y), z)[mesh.faces]


def _edges(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number of each face's three undirected edges, (m, 3), and the way it runs them, ±1 (0: no length)."""
    start, end = corners, np.roll(corners, -1, 1)
    number = _number(np.minimum(start, end).ravel(), np.maximum(start, end).ravel())
    return number.reshape(-1, 3), np.sign(end - start).astype(np.int8)


def _number(high: np.ndarray, low: np.ndarray) -> np.ndarray:
    """Number of each pair of 32-bit integers (n,) in the order of pairs, (n,) int32; equal pairs have the same one.

    Needs half of the memory of `numpy.unique`.
    """
    pairs = high.astype(np.uint64) << np.uint64(32)
    pairs |= low.astype(np.uint64)
    order = np.argsort(pairs)
    pairs = pairs[order]
    numbers = np.zeros(len(pairs), np.int32)
    numbers[order[1:]] = np.cumsum(pairs[1:] != pairs[:-1], dtype=np.int32)
    return numbers


def _pieces(edge: np.ndarray) -> np.ndarray:
    """Number of the piece of each face, (m,)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    order = np.argsort(edge, axis=None)
    edges, faces = edge.ravel()[order], (order // 3).astype(np.int32)
    is_shared = edges[1:] == edges[:-1]
    one, other = faces[:-1][is_shared], faces[1:][is_shared]
    graph = coo_matrix((np.ones(len(one)), (one, other)), shape=(len(edge), len(edge)))
    return connected_components(graph, directed=False)[1]


def _volumes(mesh: Mesh, piece: np.ndarray, n_pieces: int) -> np.ndarray:
    """Signed volume of each piece, about one of its own corners [m³]."""
    _, first = np.unique(piece, return_index=True)
    corner = mesh.vertices[mesh.faces[first, 0]]
    volume = np.zeros(len(piece))
    for start in range(0, len(piece), _BLOCK):  # in blocks: the triangles of a town in double precision take 50 MB
        rows = slice(start, start + _BLOCK)
        triangles = mesh.vertices[mesh.faces[rows]].astype(np.float64)
        a, b, c = np.moveaxis(triangles - corner[piece[rows], None], 1, 0)
        volume[rows] = (a * np.cross(b, c)).sum(1) / 6.0
    return np.bincount(piece, volume, n_pieces)

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
    x, y, z = (mesh.vertices + np.float32(0)).T.view(np.uint32).astype(np.uint64)  # + 0 turns −0 into 0
    _, column = np.unique(x << np.uint64(32) | y, return_inverse=True)
    _, number = np.unique(column.astype(np.uint64) << np.uint64(32) | z, return_inverse=True)
    return number.astype(np.int32)[mesh.faces]


def _edges(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number of each face's three undirected edges, (m, 3), and the way it runs them, ±1 (0: no length)."""
    start, end = corners, np.roll(corners, -1, 1)
    key = np.minimum(start, end) * (np.int64(corners.max()) + 1) + np.maximum(start, end)
    number = np.unique(key, return_inverse=True)[1].astype(np.int32)
    return number.reshape(-1, 3), np.sign(end - start).astype(np.int8)


def _pieces(edge: np.ndarray) -> np.ndarray:
    """Number of the piece of each face, (m,)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n_faces = len(edge)
    face = np.repeat(np.arange(n_faces, dtype=np.int32), 3)
    rows, columns = face, n_faces + edge.ravel()
    size = n_faces + edge.max() + 1
    graph = coo_matrix((np.ones(len(rows), bool), (rows, columns)), shape=(size, size))
    _, piece = np.unique(connected_components(graph, directed=False)[1][:n_faces], return_inverse=True)
    return piece.ravel()


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

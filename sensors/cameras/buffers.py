"""Packed meshes in the graphics library's memory, ready to draw. Imports OpenGL."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from OpenGL import GL

from sensors.cameras.packing import VERTEX, PackedMesh

_INSTANCE_BYTES = 16 * 4
_INDEX_BYTES = 4
_ATTRIBUTES = (
    ("position", 3, GL.GL_FLOAT, GL.GL_FALSE),
    ("normal", 3, GL.GL_BYTE, GL.GL_TRUE),
    ("colour", 4, GL.GL_UNSIGNED_BYTE, GL.GL_TRUE),
    ("shade", 3, GL.GL_UNSIGNED_BYTE, GL.GL_TRUE),
)


class InstanceBuffer:
    """The posed instances of one pass: a 4 × 4 float matrix each, refilled every frame."""

    def __init__(self) -> None:
        self.name = GL.glGenBuffers(1)

    def fill(self, rows: np.ndarray) -> None:
        """Upload (n, 4, 4) float32, row-major."""
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self.name)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, rows.nbytes, np.ascontiguousarray(rows, np.float32), GL.GL_STREAM_DRAW)


class MeshBuffer:
    """One packed mesh; with `instances`, drawn once for any number of poses."""

    def __init__(self, packed: PackedMesh, instances: InstanceBuffer | None = None) -> None:
        self._array = GL.glGenVertexArrays(1)
        GL.glBindVertexArray(self._array)
        vertices, indices = GL.glGenBuffers(2)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, vertices)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, packed.vertices.nbytes, packed.vertices, GL.GL_STATIC_DRAW)
        for slot, (field, size, kind, scaled) in enumerate(_ATTRIBUTES):
            offset = ctypes.c_void_p(_offset(field))
            GL.glVertexAttribPointer(slot, size, kind, scaled, VERTEX.itemsize, offset)
            GL.glEnableVertexAttribArray(slot)
        if instances is not None:
            GL.glBindBuffer(GL.GL_ARRAY_BUFFER, instances.name)
            for row in range(4):
                offset = ctypes.c_void_p(16 * row)
                GL.glVertexAttribPointer(4 + row, 4, GL.GL_FLOAT, GL.GL_FALSE, _INSTANCE_BYTES, offset)
                GL.glEnableVertexAttribArray(4 + row)
                GL.glVertexAttribDivisor(4 + row, 1)
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, indices)
        GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, packed.faces.nbytes, packed.faces, GL.GL_STATIC_DRAW)
        GL.glBindVertexArray(0)

    def draw_runs(self, first: np.ndarray, count: np.ndarray) -> None:
        """Draw runs of faces in the order given, in one call: first face and number of faces, (t,) each."""
        if not len(first):
            return
        GL.glBindVertexArray(self._array)
        counts = (count * 3).astype(np.int32)
        offsets = (first * 3 * _INDEX_BYTES).astype(np.uint64)
        GL.glMultiDrawElements(
            GL.GL_TRIANGLES, counts, GL.GL_UNSIGNED_INT, ctypes.c_void_p(offsets.ctypes.data), len(counts)
        )

    def draw_instances(self, faces: slice, instances: slice) -> None:
        """Draw some faces for some rows of the instance buffer."""
        n_indices = 3 * (faces.stop - faces.start)
        if not n_indices:
            return
        GL.glBindVertexArray(self._array)
        GL.glDrawElementsInstancedBaseInstance(
            GL.GL_TRIANGLES,
            n_indices,
            GL.GL_UNSIGNED_INT,
            ctypes.c_void_p(3 * faces.start * _INDEX_BYTES),
            instances.stop - instances.start,
            instances.start,
        )


@contextmanager
def back_faces(*, drawn: bool) -> Iterator[None]:
    """Draw both sides of faces, or only those that wind counter-clockwise to the viewer."""
    if drawn:
        yield
        return
    GL.glFrontFace(GL.GL_CW)  # rows run downwards, which turns every winding round
    GL.glCullFace(GL.GL_BACK)
    GL.glEnable(GL.GL_CULL_FACE)
    yield
    GL.glDisable(GL.GL_CULL_FACE)


def _offset(field: str) -> int:
    """Bytes from the start of a packed vertex to one of its fields."""
    fields: Any = VERTEX.fields
    return fields[field][1]

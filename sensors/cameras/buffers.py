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
_FIRST_BYTES = 1 << 20
_ATTRIBUTES = (
    ("position", 3, GL.GL_FLOAT, GL.GL_FALSE),
    ("normal", 3, GL.GL_BYTE, GL.GL_TRUE),
    ("colour", 4, GL.GL_UNSIGNED_BYTE, GL.GL_TRUE),
    ("shade", 4, GL.GL_UNSIGNED_BYTE, GL.GL_TRUE),
)


class InstanceBuffer:
    """The posed instances of one pass: a 4 × 4 float matrix each, refilled every frame."""

    def __init__(self) -> None:
        self.name = GL.glGenBuffers(1)

    def describe(self) -> None:
        """Describe the layout of the rows to the bound vertex array."""
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self.name)
        for row in range(4):
            GL.glVertexAttribPointer(4 + row, 4, GL.GL_FLOAT, GL.GL_FALSE, _INSTANCE_BYTES, ctypes.c_void_p(16 * row))
            GL.glEnableVertexAttribArray(4 + row)
            GL.glVertexAttribDivisor(4 + row, 1)

    def fill(self, rows: np.ndarray) -> None:
        """Upload (n, 4, 4) float32, row-major."""
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self.name)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, rows.nbytes, np.ascontiguousarray(rows, np.float32), GL.GL_STREAM_DRAW)


class GrowingBuffer:
    """Buffer of consecutive packed meshes, drawn as runs of faces.

    Args:
        instances: poses in which runs are drawn; without, meshes are drawn in world axes.
    """

    def __init__(self, instances: InstanceBuffer | None = None) -> None:
        self._array = GL.glGenVertexArrays(1)
        if instances is not None:
            GL.glBindVertexArray(self._array)
            instances.describe()
            GL.glBindVertexArray(0)
        self._commands = GL.glGenBuffers(1)
        self._vertices = _Store(GL.GL_ARRAY_BUFFER)
        self._indices = _Store(GL.GL_ELEMENT_ARRAY_BUFFER)

    def add(self, packed: PackedMesh) -> int:
        """Append a mesh; return the number of its first face."""
        GL.glBindVertexArray(self._array)
        vertex, face = self._vertices.filled // VERTEX.itemsize, self._indices.filled // (3 * _INDEX_BYTES)
        moved = self._vertices.append(packed.vertices.view(np.uint8))
        self._indices.append((packed.faces + np.uint32(vertex)).view(np.uint8).ravel())
        if moved:
            _describe_vertices()
        GL.glBindVertexArray(0)
        return face

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

    def draw_instances(self, commands: np.ndarray) -> None:
        """Draw runs of faces for runs of instances in one call.

        Args:
            commands: (t, 4) first face, number of faces, first instance, number of instances.
        """
        commands = commands[commands[:, 1] > 0]
        if not len(commands):
            return
        first, count, instance, instances = commands.T
        packed = np.stack([3 * count, instances, 3 * first, np.zeros_like(first), instance], 1).astype(np.uint32)
        GL.glBindVertexArray(self._array)
        GL.glBindBuffer(GL.GL_DRAW_INDIRECT_BUFFER, self._commands)
        GL.glBufferData(GL.GL_DRAW_INDIRECT_BUFFER, packed.nbytes, packed, GL.GL_STREAM_DRAW)
        GL.glMultiDrawElementsIndirect(GL.GL_TRIANGLES, GL.GL_UNSIGNED_INT, None, len(packed), 0)

    def close(self) -> None:
        """Free the memory."""
        GL.glDeleteBuffers(1, [self._commands])
        GL.glDeleteVertexArrays(1, [self._array])
        self._vertices.close()
        self._indices.close()


class _Store:
    """A buffer object to which bytes are appended; replaced by one of twice the size when it is full."""

    def __init__(self, kind: int) -> None:
        self._kind = kind
        self._name, self._room = 0, 0
        self.filled = 0

    def append(self, values: np.ndarray) -> bool:
        """Append bytes (n,) uint8 and leave the buffer bound; return whether the buffer object was replaced."""
        needed, moved = self.filled + len(values), False
        if needed > self._room:
            self._enlarge(max(2 * self._room, needed, _FIRST_BYTES))
            moved = True
        GL.glBindBuffer(self._kind, self._name)
        GL.glBufferSubData(self._kind, self.filled, len(values), np.ascontiguousarray(values))
        self.filled = needed
        return moved

    def close(self) -> None:
        if self._name:
            GL.glDeleteBuffers(1, [self._name])

    def _enlarge(self, room: int) -> None:
        name = GL.glGenBuffers(1)
        GL.glBindBuffer(self._kind, name)
        GL.glBufferData(self._kind, room, None, GL.GL_STATIC_DRAW)
        if self._name:
            GL.glBindBuffer(GL.GL_COPY_READ_BUFFER, self._name)
            GL.glCopyBufferSubData(GL.GL_COPY_READ_BUFFER, self._kind, 0, 0, self.filled)
            GL.glDeleteBuffers(1, [self._name])
        self._name, self._room = name, room


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


def _describe_vertices() -> None:
    """Describe the layout of packed vertices in the bound buffer to the bound vertex array."""
    for slot, (field, size, kind, scaled) in enumerate(_ATTRIBUTES):
        offset = ctypes.c_void_p(_offset(field))
        GL.glVertexAttribPointer(slot, size, kind, scaled, VERTEX.itemsize, offset)
        GL.glEnableVertexAttribArray(slot)


def _offset(field: str) -> int:
    """Bytes from the start of a packed vertex to one of its fields."""
    fields: Any = VERTEX.fields
    return fields[field][1]

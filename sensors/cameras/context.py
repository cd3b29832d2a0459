"""Pyrender's offscreen context with a working shader cache. Imports OpenGL: import it only to draw."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from OpenGL import GL
from OpenGL.error import GLError

from sensors.cameras import windowless  # noqa: F401 — before pyrender
from sensors.cameras.errors import CameraError

from pyrender import OffscreenRenderer, Renderer  # isort: skip
from pyrender.shader_program import ShaderProgram, ShaderProgramCache  # isort: skip

SHADER_DIR = Path(__file__).parent / "shaders"


class Program:
    """A linked shader program that remembers the locations and values of its uniforms, so that none is set twice."""

    def __init__(self, linked: ShaderProgram) -> None:
        self._linked = linked
        self._places: dict[str, int] = {}
        self._values: dict[str, bytes] = {}

    def use(self) -> None:
        """Make it the current program."""
        GL.glUseProgram(self._linked._program_id)

    def set(self, **values: np.ndarray | float) -> None:
        """Set uniforms of the program in use: numbers, vectors (3,) and matrices (3, 3) or (4, 4)."""
        for name, value in values.items():
            array = np.array(value, np.float32, order="C")
            if self._values.get(name) == (data := array.tobytes()):
                continue
            self._values[name] = data
            if name not in self._places:
                self._places[name] = GL.glGetUniformLocation(self._linked._program_id, name)
            _SETTERS[array.shape](self._places[name], array)


_SETTERS: dict[tuple[int, ...], Callable[[int, np.ndarray], None]] = {
    (): lambda place, value: GL.glUniform1f(place, float(value)),
    (3,): lambda place, value: GL.glUniform3fv(place, 1, value),
    (3, 3): lambda place, value: GL.glUniformMatrix3fv(place, 1, GL.GL_TRUE, value),
    (4, 4): lambda place, value: GL.glUniformMatrix4fv(place, 1, GL.GL_TRUE, value),
}


class SteadyProgramCache(ShaderProgramCache):
    """Programs compiled once.

    Pyrender's key holds the context's address wrapped in a fresh object, which never compares equal on
    OSMesa: every draw would compile and keep another program. A context has its own cache, so the key
    needs no context at all.
    """

    def __init__(self) -> None:
        super().__init__(shader_dir=str(SHADER_DIR))

    def __len__(self) -> int:
        return len(self._program_cache)

    def get_program(
        self,
        vertex_shader: str,
        fragment_shader: str,
        geometry_shader: str | None = None,
        defines: dict[str, int] | None = None,
    ) -> ShaderProgram:
        """The linked program of two or three shader files in `shaders/`."""
        key = (vertex_shader, fragment_shader, geometry_shader, *sorted((defines or {}).items()))
        if key not in self._program_cache:
            files = [str(SHADER_DIR / name) for name in (vertex_shader, fragment_shader)]
            third = str(SHADER_DIR / geometry_shader) if geometry_shader else None
            program = ShaderProgram(*files, geometry_shader=third, defines=defines)
            program._add_to_context()
            self._program_cache[key] = program
        return self._program_cache[key]


class _Programs(Renderer):
    """Pyrender's renderer reduced to the owner of the programs."""

    def __init__(self, width: int, height: int) -> None:
        super().__init__(width, height)
        self._program_cache = SteadyProgramCache()


def open_context(width: int, height: int) -> OffscreenContext:
    """A current OpenGL context of the selected backend.

    Raises:
        CameraError: the library is there but gives no context.
    """
    try:
        return OffscreenContext(width, height)
    except (AssertionError, AttributeError, ImportError, IndexError, RuntimeError, ValueError, GLError) as error:
        raise CameraError(
            f"OpenGL backend {os.environ.get('PYOPENGL_PLATFORM')!r} gives no context ({error}): "
            "try the other one of 'osmesa' and 'egl'"
        ) from error


class OffscreenContext(OffscreenRenderer):
    """An OpenGL context without a window; frame buffers and meshes in it die with it.

    Attributes:
        programs: the context's shader programs.
    """

    programs: SteadyProgramCache

    def program(self, vertex_shader: str, fragment_shader: str, **defines: int) -> Program:
        """The program of two shader files, linked on first use."""
        key = (vertex_shader, fragment_shader, *sorted(defines.items()))
        if key not in self._own:
            self._own[key] = Program(self.programs.get_program(vertex_shader, fragment_shader, defines=defines))
        return self._own[key]

    def make_current(self) -> None:
        """Direct this thread's OpenGL calls to this context."""
        platform: Any = self._platform
        platform.make_current()

    def _create(self) -> None:
        super()._create()
        self._own: dict[tuple, Program] = {}
        renderer = _Programs(self.viewport_width, self.viewport_height)
        self._renderer = renderer
        self.programs = renderer._program_cache

"""Pyrender's offscreen context with a shader cache that holds. Imports OpenGL: import it only to draw."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from OpenGL.error import GLError

from sensors.cameras import windowless  # noqa: F401 — before pyrender
from sensors.cameras.errors import CameraError

from pyrender import OffscreenRenderer, Renderer  # isort: skip
from pyrender.shader_program import ShaderProgram, ShaderProgramCache  # isort: skip

SHADER_DIR = Path(__file__).parent / "shaders"


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

    def make_current(self) -> None:
        """Direct this thread's OpenGL calls to this context."""
        platform: Any = self._platform
        platform.make_current()

    def _create(self) -> None:
        super()._create()
        renderer = _Programs(self.viewport_width, self.viewport_height)
        self._renderer = renderer
        self.programs = renderer._program_cache

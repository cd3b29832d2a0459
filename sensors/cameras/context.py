"""OpenGL contexts without a window, and shader programs. Imports OpenGL: import it only to draw.

Modules of pyrender are imported without the package's own imports: `import pyrender` loads trimesh, networkx, fonts and
the viewer of a window system, of which contexts and shader programs need none.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from OpenGL import GL
from OpenGL.error import GLError

from sensors.cameras.errors import CameraError


def _import_part(name: str) -> ModuleType:
    """Import a module of pyrender, such as `shader_program`, that does not need the rest of the package.

    Raises:
        ImportError: pyrender is not installed.
    """
    if "pyrender" in sys.modules:
        return import_module(f"pyrender.{name}")
    spec = find_spec("pyrender")
    if spec is None:
        raise ImportError("pyrender is not installed: pip install pyrender2")
    sys.modules["pyrender"] = module_from_spec(spec)  # knows where its modules are, but has not run
    try:
        return import_module(f"pyrender.{name}")
    finally:
        del sys.modules["pyrender"]  # a later import of pyrender itself loads all of it


SHADER_DIR = Path(__file__).parent / "shaders"
_SHADERS: Any = _import_part("shader_program")


class Program:
    """A linked shader program that remembers the locations and values of its uniforms, so that none is set twice."""

    def __init__(self, linked: Any) -> None:
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

    def delete(self) -> None:
        """Free the program."""
        self._linked.delete()


_SETTERS: dict[tuple[int, ...], Callable[[int, np.ndarray], None]] = {
    (): lambda place, value: GL.glUniform1f(place, float(value)),
    (3,): lambda place, value: GL.glUniform3fv(place, 1, value),
    (3, 3): lambda place, value: GL.glUniformMatrix3fv(place, 1, GL.GL_TRUE, value),
    (4, 4): lambda place, value: GL.glUniformMatrix4fv(place, 1, GL.GL_TRUE, value),
}


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


class OffscreenContext:
    """An OpenGL context without a window; frame buffers and meshes in it die with it.

    Args:
        width, height: size of its own buffer [px].

    Attributes:
        programs: the context's shader programs by the names of their files and their definitions.
    """

    def __init__(self, width: int, height: int) -> None:
        self._platform: Any = _platform(width, height)
        self._platform.init_context()
        self._platform.make_current()
        self.programs: dict[tuple, Program] = {}

    def program(self, vertex_shader: str, fragment_shader: str, **defines: int) -> Program:
        """The program of two files in `shaders/`, linked on first use."""
        key = (vertex_shader, fragment_shader, *sorted(defines.items()))
        if key not in self.programs:
            files = [str(SHADER_DIR / name) for name in (vertex_shader, fragment_shader)]
            linked = _SHADERS.ShaderProgram(*files, defines=defines)
            linked._add_to_context()
            self.programs[key] = Program(linked)
        return self.programs[key]

    def make_current(self) -> None:
        """Direct this thread's OpenGL calls to this context."""
        self._platform.make_current()

    def delete(self) -> None:
        """Free the context and all it holds; a second call does nothing."""
        if self._platform is not None:
            self._platform.make_current()
            for program in self.programs.values():
                program.delete()
            self.programs.clear()
            self._platform.delete_context()
            self._platform = None


def _platform(width: int, height: int) -> Any:
    """Pyrender's access to the selected backend's contexts."""
    if os.environ.get("PYOPENGL_PLATFORM") == "egl":
        egl = _import_part("platforms.egl")
        device = egl.get_device_by_index(int(os.environ.get("EGL_DEVICE_ID", "0")))
        return egl.EGLPlatform(width, height, device=device)
    return _import_part("platforms.osmesa").OSMesaPlatform(width, height)

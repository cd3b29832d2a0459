"""Choice of the OpenGL library, before anything loads it."""

from __future__ import annotations

import ctypes
import os
import sys

from sensors.cameras.errors import CameraError

_LIBRARIES = {
    "osmesa": (("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"), "apt-get install libosmesa6, or backend 'egl'"),
    "egl": (("libEGL.so.1", "libEGL.so"), "apt-get install libegl1, or backend 'osmesa'"),
}


def select_backend(name: str) -> None:
    """Point PyOpenGL at a library; it reads its environment once, when first imported.

    Args:
        name: `osmesa` (software, no display) or `egl` (graphics card, or Mesa's software).

    Raises:
        CameraError: unknown name, library missing, or this process already draws with the other one.
    """
    if name not in _LIBRARIES:
        raise CameraError(f"backend {name!r} is unknown: give one of {', '.join(_LIBRARIES)}")
    if "OpenGL.platform" in sys.modules and os.environ.get("PYOPENGL_PLATFORM") != name:
        loaded = os.environ.get("PYOPENGL_PLATFORM", "its default")
        raise CameraError(f"backend {name!r}: this process loaded OpenGL with {loaded}: use a new process")
    files, remedy = _LIBRARIES[name]
    if not any(_loads(file) for file in files):
        raise CameraError(f"backend {name!r} needs {files[0]}, which is not installed: {remedy}")
    os.environ["PYOPENGL_PLATFORM"] = name
    import OpenGL

    OpenGL.ERROR_CHECKING = False  # after every call it takes as long as the call; a pass checks once, at its end
    # software Mesa draws in the calling thread: worker processes already fill the cores
    os.environ.setdefault("LP_NUM_THREADS", "0")


def _loads(file: str) -> bool:
    try:
        ctypes.CDLL(file)
    except OSError:
        return False
    return True

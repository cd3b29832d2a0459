"""Colour, depth and instance images of one camera in a single pass, drawn with the OpenGL library that is selected."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np

from assets.mesh import Mesh
from sensors.cameras.baking import Shade
from sensors.cameras.errors import CameraError
from sensors.cameras.images import CONTENTS, Content, Images
from sensors.cameras.light import Light
from sensors.cameras.packed_model import PackedModel
from sensors.cameras.projection import View
from sensors.cameras.tiles import Tiles

if TYPE_CHECKING:
    from sensors.cameras.painter import Painter
    from sensors.scene import Instances


NEAR_M = 0.2
FAR_M = 400.0
_MAX_INSTANCES = 65535
_LIBRARIES = {
    "osmesa": (("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"), "apt-get install libosmesa6, or backend 'egl'"),
    "egl": (("libEGL.so.1", "libEGL.so"), "apt-get install libegl1, or backend 'osmesa'"),
}


class CameraRenderer:
    """Draws the static world and posed models with OpenGL.

    A renderer has one size; another size takes another renderer, and several may live side by side. The
    first one fixes the backend for the process. Software Mesa draws in the calling thread unless the
    environment variable LP_NUM_THREADS says otherwise: 2 gains about a fifth for a single process on two cores.

    Flat daylight without textures, reflections or moving shadows; colour is sampled once a pixel, so edges
    show steps. Glass is not drawn: depth agrees with beams that pass it. Tiles and instances that start
    beyond 400 m are left out.

    Args:
        static: the static world, world axes; or its tiles.
        models: mesh of each model name, or a function that gives it; asked once a name, when first met.
        light: sun, sky and haze.
        width, height: image size [px].
        backend: `osmesa` or `egl`.
        shade: gives the share of sun and of sky at rows of the static world's vertices, as `SunShadows` does; asked
            for those that are seen; None for none in shadow.
        packed: prepared models by name and level of detail, shared with other renderers of the same
            models and added to.

    Raises:
        CameraError: the backend's library is missing or gives no context.
    """

    def __init__(
        self,
        static: Mesh | Tiles,
        models: Mapping[str, Mesh] | Callable[[str], Mesh],
        light: Light,
        *,
        width: int,
        height: int,
        backend: str = "osmesa",
        shade: Shade | None = None,
        packed: dict[tuple[str, int], PackedModel] | None = None,
    ) -> None:
        select_backend(backend)
        from sensors.cameras.painter import Painter

        load = models if callable(models) else models.__getitem__
        self.width, self.height = width, height
        self._painter: Painter | None = Painter(load, width, height, {} if packed is None else packed)
        self.enter(static, light, shade)

    def enter(self, static: Mesh | Tiles, light: Light, shade: Shade | None = None) -> None:
        """Draw another static world, or the same in another light, from now on; arguments as of the class."""
        tiles = Tiles.of(static) if isinstance(static, Mesh) else static
        self._open_painter.enter(tiles, light, shade)

    @property
    def _open_painter(self) -> Painter:
        if self._painter is None:
            raise CameraError("the renderer is closed: make a new one")
        return self._painter

    def render(
        self,
        camera_pose_world: np.ndarray,
        P: np.ndarray,
        instances: Instances,
        wanted: Collection[Content] = CONTENTS,
    ) -> Images:
        """Images of one instant.

        Args:
            camera_pose_world: (4, 4) world-from-camera-0, axes x right, y down, z forward [m].
            P: (3, 4) projection from camera-0 axes to pixels.
            instances: instances and their poses; at most 65 535.
            wanted: what is read back of `colour` (with materials), `number` (of instances) and `depth`.
        """
        painter = self._open_painter
        if len(instances.models) > _MAX_INSTANCES:
            raise CameraError(f"{len(instances.models)} instances: numbers reach {_MAX_INSTANCES}; give fewer")
        view = View.of(camera_pose_world, P, (self.width, self.height), (NEAR_M, FAR_M))
        read = painter.paint(view, instances, wanted)
        return Images(NEAR_M, read.get("colour"), read.get("number"), read.get("depth"))

    def close(self) -> None:
        """Free the OpenGL context; the renderer cannot draw afterwards."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    def __enter__(self) -> CameraRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


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

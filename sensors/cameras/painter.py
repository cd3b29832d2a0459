"""The drawing order of one pass: near tiles, instances, sky. Imports OpenGL."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from OpenGL import GL
from pyrender.shader_program import ShaderProgram

from assets.mesh import Mesh
from sensors.cameras.context import OffscreenContext
from sensors.cameras.light import Light
from sensors.cameras.model_library import ModelLibrary
from sensors.cameras.static_world import StaticWorld
from sensors.cameras.target import RenderTarget

if TYPE_CHECKING:
    from sensors.scene import Instances


class Painter:
    """Owns the OpenGL context and everything in it."""

    def __init__(
        self,
        static: Mesh,
        load: Callable[[str], Mesh],
        light: Light,
        width: int,
        height: int,
        static_shade: np.ndarray | None,
    ) -> None:
        self._light = light
        self._context = OffscreenContext(width, height)
        self._target = RenderTarget(width, height)
        self._static = StaticWorld(static, static_shade)
        self._models = ModelLibrary(load)
        self._nothing = GL.glGenVertexArrays(1)

    def paint(
        self, camera_from_world: np.ndarray, clip: np.ndarray, planes: np.ndarray, instances: Instances
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Draw everything and read it back: RGBA, instance number, near / depth, each (h, w, …)."""
        self._context.make_current()
        self._target.begin()
        self._draw_static(camera_from_world, clip, planes)
        self._draw_instances(camera_from_world, clip, planes, instances)
        self._draw_sky(camera_from_world, clip)
        return self._target.read()

    def close(self) -> None:
        """Destroy the context and all it holds."""
        self._context.delete()

    def _draw_static(self, camera_from_world: np.ndarray, clip: np.ndarray, planes: np.ndarray) -> None:
        rotation = camera_from_world[:3, :3]
        eye = -np.linalg.solve(rotation, camera_from_world[:3, 3])
        program = self._surface_program(rotation, clip)
        program.set_uniform("view", rotation)
        program.set_uniform("eye", eye)
        program.set_uniform("eye_rest", eye - eye.astype(np.float32))
        self._static.draw(planes, eye)

    def _draw_instances(
        self, camera_from_world: np.ndarray, clip: np.ndarray, planes: np.ndarray, instances: Instances
    ) -> None:
        self._surface_program(camera_from_world[:3, :3], clip, INSTANCED=1)
        self._models.draw(instances, camera_from_world, planes)

    def _surface_program(self, rotation: np.ndarray, clip: np.ndarray, **defines: int) -> ShaderProgram:
        light = self._light
        program = self._context.programs.get_program("surface.vert", "surface.frag", defines=defines)
        program._bind()
        program.set_uniform("clip", clip)
        program.set_uniform("sun", rotation @ np.array(light.sun_direction))
        program.set_uniform("up", rotation[:, 2].copy())
        program.set_uniform("sun_rgb", np.array(light.sun_rgb) * light.exposure)
        program.set_uniform("sky_rgb", np.array(light.sky_rgb) * light.exposure)
        program.set_uniform("ground_rgb", np.array(light.ground_rgb) * light.exposure)
        program.set_uniform("haze_rgb", np.array(light.horizon_rgb) * light.exposure)
        program.set_uniform("haze_per_m", float(light.haze_per_m))
        return program

    def _draw_sky(self, camera_from_world: np.ndarray, clip: np.ndarray) -> None:
        light = self._light
        program = self._context.programs.get_program("sky.vert", "sky.frag")
        program._bind()
        program.set_uniform("ray", np.linalg.inv(clip[[0, 1, 3], :3]))
        program.set_uniform("up", camera_from_world[:3, 2].copy())
        program.set_uniform("zenith_rgb", np.array(light.zenith_rgb) * light.exposure)
        program.set_uniform("horizon_rgb", np.array(light.horizon_rgb) * light.exposure)
        GL.glDepthFunc(GL.GL_GEQUAL)
        GL.glBindVertexArray(self._nothing)
        GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)

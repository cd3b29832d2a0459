"""Drawing order of one pass: near surfaces, those that they do not hide, the sky. Imports OpenGL."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

import numpy as np
from OpenGL import GL

from assets.mesh import Mesh
from sensors.cameras.baking import Shade
from sensors.cameras.buffers import GrowingBuffer, back_faces
from sensors.cameras.context import Program, open_context
from sensors.cameras.images import Content
from sensors.cameras.light import Light
from sensors.cameras.model_library import ModelLibrary
from sensors.cameras.occlusion import Horizon, box_corners
from sensors.cameras.packed_model import PackedModel
from sensors.cameras.packing import pack
from sensors.cameras.projection import View
from sensors.cameras.target import RenderTarget
from sensors.cameras.tiles import Tiles

if TYPE_CHECKING:
    from sensors.scene import Instances


_NEAR_TILES_M, _MIDDLE_TILES_M = 60.0, 150.0
_NEAR_INSTANCES = 16


class Painter:
    """Owns the OpenGL context and everything in it."""

    def __init__(
        self,
        load: Callable[[str], Mesh],
        width: int,
        height: int,
        packed: dict[tuple[str, int], PackedModel],
    ) -> None:
        self._light = Light()
        self._context = open_context(width, height)
        self._target = RenderTarget(width, height)
        self._static = _StaticWorld(Tiles.of(Mesh.empty()), None)
        self._models = ModelLibrary(load, packed)
        self._nothing = GL.glGenVertexArrays(1)

    def enter(self, tiles: Tiles, light: Light, shade: Shade | None) -> None:
        """Draw another static world, or the same in another light, from now on."""
        self._context.make_current()
        self._static.close()
        self._light, self._static = light, _StaticWorld(tiles, shade)

    def paint(self, view: View, instances: Instances, wanted: Collection[Content]) -> dict[Content, np.ndarray]:
        """Draw everything and read back the requested images, as `RenderTarget.read`.

        Near surfaces are drawn first, then those in the middle, then those far away; of the last two, only those that
        surfaces drawn before do not hide.
        """
        self._context.make_current()
        self._target.begin()
        tiles, distance = self._static.tiles.in_view(view.planes, view.eye)
        actors, corners = self._models.in_view(instances, view.planes, view.eye)
        near = distance < _NEAR_TILES_M
        self._draw_static(view, tiles[near])
        self._draw_instances(view, instances, actors[:_NEAR_INSTANCES])

        far, distance = tiles[~near], distance[~near]
        actors, corners = actors[_NEAR_INSTANCES:], corners[_NEAR_INSTANCES:]
        if len(far) or len(actors):
            is_seen = ~self._hides_tiles(self._horizon(view), far)
            far, distance = far[is_seen], distance[is_seen]
            is_first = self._static.tiles.closed[far] | (distance < _MIDDLE_TILES_M)  # closed ones come before others
            self._draw_static(view, far[is_first])
            horizon, far = self._horizon(view), far[~is_first]
            self._draw_static(view, far[~self._hides_tiles(horizon, far)])
            self._draw_instances(view, instances, actors[~horizon.hides(corners)])
        self._draw_sky(view)
        return self._target.read(wanted)

    def _horizon(self, view: View) -> Horizon:
        """What is drawn so far, as an occluder."""
        return Horizon(self._target.read_depth(), view.clip @ view.camera_from_world, view.near_m)

    def _hides_tiles(self, horizon: Horizon, tiles: np.ndarray) -> np.ndarray:
        return horizon.hides(box_corners(self._static.tiles.bounds[tiles]))

    def close(self) -> None:
        """Destroy the context and all it holds."""
        self._context.delete()

    def _draw_static(self, view: View, tiles: np.ndarray) -> None:
        if not len(tiles):
            return
        self._surface_program(view).set(
            view=view.camera_from_world[:3, :3],
            eye=view.eye,
            eye_rest=view.eye - view.eye.astype(np.float32),
        )
        self._static.draw(tiles)

    def _draw_instances(self, view: View, instances: Instances, rows: np.ndarray) -> None:
        if len(rows):
            self._surface_program(view, INSTANCED=1)
            self._models.draw(instances, rows, view)

    def _surface_program(self, view: View, **defines: int) -> Program:
        light, rotation = self._light, view.camera_from_world[:3, :3]
        program = self._context.program("surface.vert", "surface.frag", **defines)
        program.use()
        program.set(
            clip=view.clip,
            sun=rotation @ np.array(light.sun_direction),
            up=rotation[:, 2],
            sun_rgb=np.array(light.sun_rgb) * light.exposure,
            sky_rgb=np.array(light.sky_rgb) * light.exposure,
            ground_rgb=np.array(light.ground_rgb) * light.exposure,
            haze_rgb=np.array(light.horizon_rgb) * light.exposure,
            haze_per_m=light.haze_per_m,
        )
        return program

    def _draw_sky(self, view: View) -> None:
        light = self._light
        program = self._context.program("sky.vert", "sky.frag")
        program.use()
        program.set(
            ray=np.linalg.inv(view.clip[[0, 1, 3], :3]),
            up=view.camera_from_world[:3, 2],
            zenith_rgb=np.array(light.zenith_rgb) * light.exposure,
            horizon_rgb=np.array(light.horizon_rgb) * light.exposure,
        )
        GL.glDepthFunc(GL.GL_GEQUAL)
        GL.glBindVertexArray(self._nothing)
        GL.glDrawArrays(GL.GL_TRIANGLES, 0, 3)


class _StaticWorld:
    """A buffer of the tiles seen so far, because a single drive sees only a small part of a town.

    Args:
        tiles: of the world.
        shade: gives the share of sun and of sky at rows of the world's vertices; None for none in shadow.
    """

    def __init__(self, tiles: Tiles, shade: Shade | None) -> None:
        self.tiles = tiles
        self._shade = shade
        self._first = np.full(len(tiles.first), -1, np.int64)  # in the buffer
        self._buffer = GrowingBuffer()

    def draw(self, rows: np.ndarray) -> None:
        """Draw some tiles (k,) in the order given, closed surfaces first; the program must be in use."""
        new = rows[self._first[rows] < 0]
        if len(new):
            self._make_ready(new)
        for closed in (True, False):
            chosen = rows[self.tiles.closed[rows] == closed]
            with back_faces(drawn=not closed):
                self._buffer.draw_runs(self._first[chosen], self.tiles.count[chosen])

    def close(self) -> None:
        """Free the graphics memory."""
        self._buffer.close()

    def _make_ready(self, rows: np.ndarray) -> None:
        mesh, faces, count = self.tiles.mesh, self.tiles.faces_of(rows), self.tiles.count[rows]
        # Tiles share no vertices, so that each is packed in the same way whichever others are prepared with it.
        own = np.repeat(np.arange(len(rows)), count)[:, None] * len(mesh.vertices) + mesh.faces[faces]
        used, corners = np.unique(own, return_inverse=True)
        used %= len(mesh.vertices)
        shade = None if self._shade is None else self._shade(used)
        packed = pack(Mesh(mesh.vertices[used], corners.reshape(-1, 3), mesh.materials[faces]), shade)
        self._first[rows] = self._buffer.add(packed) + np.cumsum(count) - count

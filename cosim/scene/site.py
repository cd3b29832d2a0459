"""A town with one of its random worlds, prepared for driving, scanning and rendering."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from assets import Mesh
from assets.cache import cached_latest
from assets.streets import Streets
from assets.world.build import BuiltWorld, build_world
from assets.world.environment import Environment
from assets.world.furniture.props import SignalHead
from cosim.capture.config import RunConfig
from cosim.scene.ground import Ground
from sensors.cameras import CameraRenderer, Light, PackedModel, SunShadows, Tiles
from sensors.cameras.tiles import cut_world
from sensors.scene import Scene, TracedModel
from sumo_nets import Town
from sumo_nets.local_origin import shift_streets

_WORLD_STREAM, _LIGHT_STREAM = 0, 1  # independent random streams
_build_world = cached_latest(8)(build_world)  # 40 MB each
_COORDINATE_DECIMALS = 6  # what remains of a subtraction in double precision


@dataclass(frozen=True, eq=False)
class Models:
    """Cache of models that all sites share.

    Attributes:
        load: returns the mesh of a model name.
        traced: models for ray tracing, by name.
        packed: models for rendering, by name and level of detail.
    """

    load: Callable[[str], Mesh]
    traced: dict[str, TracedModel] = field(default_factory=dict)
    packed: dict[tuple[str, int], PackedModel] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Land:
    """A town, or a part of it, without what its random worlds add: buildings, plants, street furniture.

    Attributes:
        town: streets and traffic of the whole town.
        streets: streets that are built.
    """

    town: Town
    streets: Streets

    @cached_property
    def corner_m(self) -> np.ndarray:
        """(3,) local origin of the world [m]: the lower corner of the streets, so that offsets do not matter."""
        if self.town.is_built_in:
            return np.zeros(3)
        low = np.min([lane.centre[:, :2].min(0) for lane in self.streets.lanes], axis=0)
        return np.array([*low, 0.0])

    @cached_property
    def local_streets(self) -> Streets:
        """The streets that are built, relative to the corner."""
        if not self.corner_m.any():
            return self.streets
        return shift_streets(self.streets, -self.corner_m, _COORDINATE_DECIMALS)

    def build(self, seed: int, environment: Environment) -> BuiltWorld:
        """Build a random world, relative to the corner."""
        return _build_world(self.local_streets, seed, environment)

    def place(self, mesh: Mesh) -> Mesh:
        """Move a mesh from the corner to its position in the town."""
        if not self.corner_m.any():
            return mesh
        return Mesh(mesh.vertices.astype(np.float64) + self.corner_m, mesh.faces, mesh.materials)


@dataclass(frozen=True, eq=False)
class Site:
    """Location of an episode: a town with one of its static worlds.

    Attributes:
        land: land of the town.
        world: number of the random world.
        mesh: mesh of the static world.
        scene: scene for ray tracing.
        ground: height queries on the ground; on the whole world where that is a user's mesh.
        tiles: tiles of the world for rendering.
        shadows: shadows that the world casts on itself.
        signals: heads of the traffic signals.
        seats: (k, 4, 4) world poses of the seats of the street furniture.
    """

    land: Land
    world: int
    mesh: Mesh
    scene: Scene
    ground: Ground
    tiles: Tiles
    shadows: SunShadows
    signals: tuple[SignalHead, ...] = ()
    seats: np.ndarray = field(default_factory=lambda: np.zeros((0, 4, 4)))

    @classmethod
    def build(cls, config: RunConfig, land: Land, world: int, *, models: Models, threads: int) -> Site:
        """Build the world for the run's seed, the town and the world's number."""
        town = land.town
        if config.world is not None:
            mesh = config.world.read(town.streets)
            return cls._of(land, world, mesh, mesh, models, threads)
        seeds = [config.seed, zlib.crc32(town.name.encode()), world]
        environment = config.environment.draw(np.random.default_rng([*seeds, _WORLD_STREAM]))
        static = land.build(int(np.random.default_rng(seeds).integers(2**31)), environment)
        to_town = np.eye(4)
        to_town[:3, 3] = land.corner_m
        signals = tuple(replace(head, pose=to_town @ head.pose) for head in static.signals)
        site = cls._of(land, world, land.place(static.mesh), land.place(static.ground), models, threads)
        return replace(site, signals=signals, seats=to_town @ static.seats)

    @classmethod
    def _of(
        cls,
        land: Land,
        world: int,
        mesh: Mesh,
        ground: Mesh,
        models: Models,
        threads: int,
    ) -> Site:
        scene = Scene(mesh, models.load, threads, models=models.traced)
        tiles = cut_world(mesh)
        shadows = SunShadows(mesh, Light(), scene.static, tiles.vertex_normals)
        return cls(land, world, mesh, scene, Ground(ground), tiles, shadows)

    def show(self, renderer: CameraRenderer, light: Light) -> None:
        """Load this site and a light into a renderer."""
        renderer.enter(self.tiles, light, self.shadows.under(light))


def light_of(config: RunConfig, episode: int) -> Light:
    """Light of an episode; depends on the run's seed and the episode's number."""
    return draw_light(np.random.default_rng([config.seed, episode, _LIGHT_STREAM]))


def draw_light(rng: np.random.Generator) -> Light:
    """Draw sun and sky of a random time of day and weather."""
    clear = float(rng.uniform(0.35, 1.0))
    return Light(
        sun_elevation_deg=float(rng.uniform(22, 60)),
        sun_azimuth_deg=float(rng.uniform(-180, 180)),
        sun_rgb=(0.80 * clear, 0.76 * clear, 0.68 * clear),
        exposure=float(rng.uniform(0.9, 1.0)) / (0.45 + 0.55 * clear),
    )

"""A town with one of its random worlds, ready to be driven through, scanned and drawn."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from assets import Mesh
from assets.world import Groundwork, SignalHead, build_world, lay_groundwork
from cosim.capture.config import RunConfig
from cosim.scene.ground import Ground
from sensors.cameras import CameraRenderer, Light, PackedModel, SunShadows, Tiles
from sensors.scene import Scene, TracedModel
from sumo_nets import Town, read_town

_WORLD_STREAM, _LIGHT_STREAM = 0, 1  # keep the random numbers of world and light apart


@dataclass(frozen=True, eq=False)
class Models:
    """Models as places need them, each made ready once for all of them.

    Attributes:
        load: gives the mesh of a name.
        traced: by name, for rays.
        packed: by name and level of detail, for images.
    """

    load: Callable[[str], Mesh]
    traced: dict[str, TracedModel] = field(default_factory=dict)
    packed: dict[tuple[str, int], PackedModel] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Land:
    """A town without buildings, plants and furniture: what all its worlds have in common.

    Attributes:
        town: its streets and traffic.
        groundwork: its roads and land.
        ground: the same as wheels stand on it.
    """

    town: Town
    groundwork: Groundwork
    ground: Ground

    @classmethod
    def of(cls, name: str) -> Land:
        """That of a town, by name or path.

        Raises:
            TownError: there is no such town, or its files cannot be used.
        """
        town = read_town(name)
        groundwork = lay_groundwork(town.streets)
        return cls(town, groundwork, Ground(groundwork.ground))


@dataclass(frozen=True, eq=False)
class Site:
    """Where episodes happen.

    Attributes:
        land: the town.
        world: number of the random world.
        mesh: the static world.
        scene: the world as rays meet it.
        tiles: the world as cameras draw it.
        shadows: of the world on itself.
        signals: heads of its traffic signals.
    """

    land: Land
    world: int
    mesh: Mesh
    scene: Scene
    tiles: Tiles
    shadows: SunShadows
    signals: tuple[SignalHead, ...] = ()

    @classmethod
    def build(cls, config: RunConfig, land: Land, world: int, *, models: Models, threads: int) -> Site:
        """Build the world that the run's seed, the town and the world's number determine."""
        town, groundwork = land.town, land.groundwork
        if config.world is not None:
            return cls._of(land, world, config.world.read(town.streets), (), models, threads)
        seeds = [config.seed, zlib.crc32(town.name.encode()), world]
        environment = config.environment.draw(np.random.default_rng([*seeds, _WORLD_STREAM]))
        static = build_world(town.streets, int(np.random.default_rng(seeds).integers(2**31)), environment, groundwork)
        return cls._of(land, world, static.mesh, static.signals, models, threads)

    @classmethod
    def _of(
        cls, land: Land, world: int, mesh: Mesh, signals: tuple[SignalHead, ...], models: Models, threads: int
    ) -> Site:
        scene = Scene(mesh, models.load, threads, models=models.traced)
        return cls(land, world, mesh, scene, Tiles.of(mesh), SunShadows(mesh, Light(), scene.static), signals)

    def show(self, renderer: CameraRenderer, light: Light) -> None:
        """Let a renderer draw this place in a light."""
        renderer.enter(self.tiles, light, self.shadows.under(light))


def light_of(config: RunConfig, episode: int) -> Light:
    """The light of an episode, which the run's seed and the episode's number determine."""
    return draw_light(np.random.default_rng([config.seed, episode, _LIGHT_STREAM]))


def draw_light(rng: np.random.Generator) -> Light:
    """Sun and sky of a random hour and weather."""
    clear = float(rng.uniform(0.35, 1.0))
    return Light(
        sun_elevation_deg=float(rng.uniform(22, 60)),
        sun_azimuth_deg=float(rng.uniform(-180, 180)),
        sun_rgb=(0.80 * clear, 0.76 * clear, 0.68 * clear),
        exposure=float(rng.uniform(0.9, 1.0)) / (0.45 + 0.55 * clear),
    )

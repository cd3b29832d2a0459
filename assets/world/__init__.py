"""The static world of a town: ground, streets, buildings, plants and furniture."""

from assets.world.build import World, build_world

__all__ = ["World", "build_world"]

"""Tiles of a static world, computed or read from the cache."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from sensors.cameras.tiles import Tiles, cut_world
from tests.sensors.worlds import block, plane, wall


def test_tiles_from_the_cache_equal_new_ones_and_share_the_vertices(tmp_path, monkeypatch):
    monkeypatch.setattr("assets.cache._folder", lambda package, where: tmp_path)
    world = Mesh.merge([plane(half_m=60.0), wall(40.0), wall(30.0, "window_glass"), block((4.0, 2.0, 1.5))])
    expected = Tiles.of(world)
    for cut in (cut_world(world), cut_world(world)):
        assert np.shares_memory(cut.mesh.vertices, world.vertices)
        for name, value in vars(expected).items():
            if name != "mesh":
                np.testing.assert_array_equal(getattr(cut, name), value, err_msg=name)
        np.testing.assert_array_equal(cut.mesh.faces, expected.mesh.faces)
        np.testing.assert_array_equal(cut.mesh.materials, expected.mesh.materials)
    assert expected.count.sum() == len(world.faces) - 2  # glass is not drawn
    assert len(list(tmp_path.glob("_cut-*.bin"))) == 1

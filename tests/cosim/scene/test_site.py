"""The world of a user's network does not depend on where the network lies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from assets.world.environment import Environment
from cosim.scene.ground import Ground
from cosim.scene.site import Land
from sumo_nets import Town, read_town
from sumo_nets.local_origin import move_file
from sumo_nets.tools import run_tool
from sumo_nets.xml_guard import read_xml


@pytest.fixture(scope="module")
def net(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("net") / "n.net.xml"
    run_tool("netgenerate", "--grid", "--grid.number", "2", "--grid.length", "90", "--sidewalks.guess", "-o", path)
    return path


def moved(net: Path, folder: Path, x_m: float, y_m: float) -> Town:
    """The streets of a network, moved by an offset."""
    (folder / net.name).write_bytes(move_file(net, read_xml(net), (-x_m, -y_m, 0.0)).read_bytes())
    return read_town(folder / net.name)


@pytest.mark.parametrize("offset", [(400_000.0, 5_600_000.0), (400_123.45, 5_600_456.78), (-731.27, 88.09)])
def test_a_moved_network_has_the_same_world(net, offset, tmp_path):
    town = moved(net, tmp_path, *offset)
    here, there = (Land(each, each.streets) for each in (read_town(net), town))
    remaining = np.array([*offset, 0.0]) - town.streets.origin_m
    worlds = [land.build(3, Environment()) for land in (here, there)]
    meshes = [land.place(world.mesh) for land, world in zip((here, there), worlds, strict=True)]
    assert np.array_equal(meshes[0].faces, meshes[1].faces)
    np.testing.assert_allclose(meshes[1].vertices - remaining, meshes[0].vertices, atol=1e-3)
    spots = np.column_stack([np.random.default_rng(1).uniform(0, 90, (200, 2)), np.zeros(200)])
    grounds = [Ground(land.place(world.ground)) for land, world in zip((here, there), worlds, strict=True)]
    heights = grounds[0].height(spots), grounds[1].height(spots + remaining)
    np.testing.assert_allclose(heights[0], heights[1], atol=1e-3)

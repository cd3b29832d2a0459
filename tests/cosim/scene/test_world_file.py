"""A user's mesh as the static world: vehicles are on it, beams hit it, and invalid meshes are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from pydantic import ValidationError

from cosim.drives.kitti import Drive
from cosim.drives.twin.glb import read_glb
from cosim.scene.world_file import WorldError, WorldFile, guess_material
from sumo_nets import read_town
from tests.cosim.conftest import refused
from tests.sharing import record

HEIGHT_M = 0.8


def write_world(path: Path, town, names: tuple[str, str], shift_m: float = 0.0) -> Path:
    """A plane a little over the town's lanes with a wall in its middle; glTF axes, y up."""
    points = np.concatenate([lane.centre for lane in town.streets.lanes])
    low, high, z = points.min(0) - 30 + shift_m, points.max(0) + 30 + shift_m, float(points[:, 2].max()) + HEIGHT_M - 1
    corners = np.array([[low[0], z, -low[1]], [high[0], z, -low[1]], [high[0], z, -high[1]], [low[0], z, -high[1]]])
    plane = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    box = trimesh.creation.box((20, 9, 0.5))
    box.apply_translation(((low[0] + high[0]) / 2, z + 4.5, -(low[1] + high[1]) / 2))
    scene = trimesh.Scene()
    for shape, name in zip((plane, box), names, strict=True):
        material = trimesh.visual.material.PBRMaterial(name=name) if name else None
        shape.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(shape)
    scene.export(path)
    return path


@pytest.fixture(scope="module")
def town(hamlet_config):
    return read_town(hamlet_config.parent / "town")


def test_a_drive_in_it_stands_on_it(town, hamlet_config, tmp_path):
    world = write_world(tmp_path / "w.glb", town, ("MI_Road_Asphalt.001", "Building_Wall"))
    values = yaml.safe_load(hamlet_config.read_text()) | {"world": str(world), "frames": 2, "images": ["image_2"]}
    (tmp_path / "c.yaml").write_text(yaml.safe_dump(values))
    record(tmp_path / "c.yaml", tmp_path / "d")
    plane = float(read_glb(world, {"MI_Road_Asphalt.001": "asphalt", "Building_Wall": "brick"}).vertices[:, 2].min())
    for frame in Drive(tmp_path / "d"):
        assert frame.twin.ego.pose[2, 3] == pytest.approx(plane, abs=0.02)
        points = frame.points[:, :3] @ frame.twin.lidar.pose_ego[:3, :3].T + frame.twin.lidar.pose_ego[:3, 3]
        near = np.hypot(*points[:, :2].T) < 15
        assert np.median(points[near, 2]) == pytest.approx(0, abs=0.03)


def test_words_of_names_tell_materials():
    assert guess_material("MI_Road_Asphalt.001") == "asphalt" and guess_material("house_roof") == "roof_tile"
    assert guess_material("TreeLeaves") == "foliage" and guess_material("xyzzy") is None
    assert guess_material("brick") == "brick"


def test_materials_may_be_said(town, tmp_path):
    world = write_world(tmp_path / "w.glb", town, ("Mat_1", "Mat_2"))
    with pytest.raises(WorldError, match="'Mat_1', 'Mat_2' are unknown"):
        WorldFile(file=world).read(town.streets)
    assert len(WorldFile(file=world, materials={"Mat_1": "asphalt", "Mat_2": "brick"}).read(town.streets).faces) > 10
    with pytest.raises(ValidationError, match="'bricks' is not a material"):
        WorldFile(file=world, materials={"Mat_1": "bricks"})


def test_what_cannot_be_a_world_is_refused_in_one_line(town, hamlet_config, tmp_path):
    def said(world: Path) -> str:
        values = yaml.safe_load(hamlet_config.read_text()) | {"world": str(world)}
        (tmp_path / "c.yaml").write_text(yaml.safe_dump(values))
        return refused("run", tmp_path / "c.yaml", "--out", tmp_path / "d")

    assert "no named materials" in said(write_world(tmp_path / "a.glb", town, ("", "")))
    assert "have a surface in it" in said(write_world(tmp_path / "b.glb", town, ("road", "wall"), shift_m=5000.0))
    (tmp_path / "c.glb").write_bytes(b"no mesh")
    assert "not a binary glTF file" in said(tmp_path / "c.glb")
    assert "cannot be read" in said(tmp_path / "none.glb")

"""Twins: worlds as glTF that any tool opens, materials, and frames as JSON."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from assets.materials import MATERIAL_NAMES, MATERIALS
from assets.mesh import Mesh
from cosim.drives.twin import (
    Ego,
    Instance,
    Lidar,
    TwinCamera,
    TwinFrame,
    encode_glb,
    format_materials,
    read_frame,
    read_glb,
    read_materials,
    write_frame,
    write_glb,
    write_materials,
)
from cosim.errors import FormatError


def _mesh(seed: int, faces: int = 40) -> Mesh:
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-500, 500, (30, 3))
    return Mesh(vertices, rng.integers(0, 30, (faces, 3)), rng.integers(0, len(MATERIAL_NAMES), faces))


def _by_material(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(mesh.materials, kind="stable")
    return mesh.triangles[order], mesh.materials[order]


@settings(deadline=None)
@given(seed=st.integers(0, 2**32 - 1), faces=st.integers(1, 60))
def test_triangles_and_materials_survive_the_file_exactly(
    tmp_path_factory: pytest.TempPathFactory, seed: int, faces: int
) -> None:
    mesh, file = _mesh(seed, faces), tmp_path_factory.mktemp("glb") / "a.glb"
    write_glb(file, mesh)
    read = read_glb(file)
    for found, expected in zip(_by_material(read), _by_material(mesh), strict=True):
        assert np.array_equal(found, expected)
    assert encode_glb(read) == file.read_bytes() == encode_glb(_mesh(seed, faces))


def test_an_empty_world_is_a_valid_file(tmp_path: Path) -> None:
    write_glb(tmp_path / "a.glb", Mesh.empty())
    data = (tmp_path / "a.glb").read_bytes()
    assert struct.unpack("<4sII", data[:12]) == (b"glTF", 2, len(data))
    assert len(read_glb(tmp_path / "a.glb").faces) == 0


def test_up_is_y_in_the_file_and_north_is_minus_z(tmp_path: Path) -> None:
    mesh = Mesh.of(np.array([[1, 2, 3], [4, 5, 6], [7, 8, 10]]), np.array([[0, 1, 2]]), "brick")
    write_glb(tmp_path / "a.glb", mesh)
    scene = trimesh.load_scene(str(tmp_path / "a.glb"), process=False)
    assert np.allclose(scene.geometry["brick"].vertices, [[1, 3, -2], [4, 6, -5], [7, 10, -8]])


def test_there_is_one_named_mesh_a_material_with_its_colour(tmp_path: Path) -> None:
    mesh = Mesh.merge([_mesh(0), _mesh(1)])
    data = encode_glb(mesh)
    length = struct.unpack("<I", data[12:16])[0]
    document = json.loads(data[20 : 20 + length])
    names = mesh.material_names()
    assert [entry["name"] for entry in document["materials"]] == names
    assert [entry["name"] for entry in document["meshes"]] == names
    for entry in document["materials"]:
        material = MATERIALS[entry["name"]]
        *rgb, alpha = entry["pbrMetallicRoughness"]["baseColorFactor"]
        assert rgb == list(material.rgb)
        assert (alpha < 1) == (material.kind == "glass") == (entry.get("alphaMode") == "BLEND")
    for view in document["bufferViews"]:
        assert view["byteOffset"] % 4 == 0
        assert view["byteOffset"] + view["byteLength"] <= document["buffers"][0]["byteLength"]
    assert len(data) % 4 == 0


def test_files_of_other_tools_are_read_with_their_transforms(tmp_path: Path) -> None:
    box = trimesh.creation.box((2, 2, 2))
    box.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name="brick"))
    scene = trimesh.Scene()
    scene.add_geometry(box, transform=trimesh.transformations.translation_matrix([10, 5, -3]))
    scene.export(str(tmp_path / "a.glb"))
    mesh = read_glb(tmp_path / "a.glb")
    assert np.allclose(mesh.bounds, [[9, 2, 4], [11, 4, 6]])
    assert mesh.material_names() == ["brick"]
    outward = (mesh.normals * (mesh.triangles.mean(1) - [10, 3, 5])).sum(1)
    assert (outward > 0).all()


def test_unknown_materials_are_all_named_or_mapped(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for name in ("lava", "jelly"):
        box = trimesh.creation.box((1, 1, 1))
        box.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name=name))
        scene.add_geometry(box)
    scene.export(str(tmp_path / "a.glb"))
    with pytest.raises(FormatError, match=r"a\.glb: material names 'jelly', 'lava' are not in the material table"):
        read_glb(tmp_path / "a.glb")
    mesh = read_glb(tmp_path / "a.glb", materials={"lava": "asphalt", "jelly": "grass"})
    assert mesh.material_names() == ["asphalt", "grass"]


@pytest.mark.parametrize("content", [b"", b"glTF", b"hello", encode_glb(_mesh(0))[:500]])
def test_broken_glb_files_are_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.glb").write_bytes(content)
    with pytest.raises(FormatError, match=r"a\.glb: not a (binary|readable) glTF file"):
        read_glb(tmp_path / "a.glb")


def test_materials_of_all_names_survive_the_file(tmp_path: Path) -> None:
    write_materials(tmp_path / "materials.yaml", MATERIAL_NAMES)
    entries = read_materials(tmp_path / "materials.yaml")
    assert sorted(entries) == sorted(MATERIAL_NAMES)
    for name, entry in entries.items():
        material = MATERIALS[name]
        assert (entry.reflectance, entry.albedo, entry.kind) == (
            material.reflectance,
            material.albedo,
            material.kind,
        )
        assert (entry.retro, entry.metal, entry.road, entry.paint) == (
            material.retro,
            material.metal,
            material.road,
            material.paint,
        )


def test_a_material_is_written_with_its_documented_keys() -> None:
    assert yaml.safe_load(format_materials(["car_glass"])) == {
        "car_glass": {
            "reflectance": 0.08,
            "albedo": MATERIALS["car_glass"].albedo,
            "class": "glass",
            "retro": False,
            "metal": False,
            "road": False,
            "paint": False,
        }
    }


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("brick: {reflectance: 1.5, albedo: 0.2}", "brick → reflectance: .* less than or equal to 1 .*found 1.5"),
        ("brick: {albedo: 0.2}", "brick → reflectance: Field required"),
        ("brick: {reflectance: 0.1, albedo: 0.2, shiny: true}", "brick → shiny"),
        ("brick: {reflectance: 0.1, albedo: 0.2, class: wood}", "brick → class"),
        ("[1, 2]", "holds list, not keys"),
        ("a: [", "not readable as YAML"),
    ],
)
def test_broken_materials_are_named(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "m.yaml").write_text(content)
    with pytest.raises(FormatError, match=rf"m\.yaml: .*{message}"):
        read_materials(tmp_path / "m.yaml")


def _pose(rng: np.random.Generator) -> np.ndarray:
    pose = np.eye(4)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pose[:3, :3] = rotation * np.sign(np.linalg.det(rotation))
    pose[:3, 3] = rng.uniform(-2000, 2000, 3)
    return pose


def _frame(seed: int = 0, instances: int = 3) -> TwinFrame:
    rng = np.random.default_rng(seed)
    cars = tuple(
        Instance(
            id=f"veh{row}",
            kind="car",
            model="hatchback_03",
            pose=_pose(rng),
            velocity_mps=rng.normal(size=3),
            yaw_rate_radps=float(rng.normal()),
            length_m=4.1,
            width_m=1.7,
            height_m=1.5,
            scale=np.ones(3),
            paint=0.42,
        )
        for row in range(instances)
    )
    camera = TwinCamera(_pose(rng), rng.normal(size=(3, 4)), 1242, 375)
    ego = Ego(_pose(rng), rng.normal(size=3), 0.1, rng.normal(size=3))
    return TwinFrame("000000", 12.3, 0.1, ego, Lidar(_pose(rng), "hdl64e"), {"image_0": camera}, cars)


@given(st.integers(0, 2**32 - 1), st.integers(0, 4))
def test_frames_survive_the_file_to_a_micrometre(seed: int, instances: int) -> None:
    frame = _frame(seed, instances)
    read = TwinFrame.from_json(frame.to_json())
    assert np.abs(read.ego.pose - frame.ego.pose).max() <= 0.5e-6
    assert np.abs(read.lidar.pose_ego[:3, :3] - frame.lidar.pose_ego[:3, :3]).max() <= 0.5e-9
    assert len(read.instances) == instances
    for found, expected in zip(read.instances, frame.instances, strict=True):
        assert (found.id, found.kind, found.model, found.paint) == (
            expected.id,
            expected.kind,
            expected.model,
            expected.paint,
        )
        assert np.abs(found.velocity_mps - expected.velocity_mps).max() <= 0.5e-6
    assert read.to_json() == frame.to_json()


def test_the_keys_are_the_documented_ones() -> None:
    document = json.loads(_frame().to_json())
    assert list(document) == ["frame", "time_s", "sweep_s", "ego", "lidar", "cameras", "instances"]
    assert list(document["ego"]) == ["pose", "velocity_mps", "yaw_rate_radps", "acceleration_mps2"]
    assert list(document["lidar"]) == ["pose_ego", "pattern"]
    assert list(document["cameras"]["image_0"]) == ["pose_ego", "P", "width", "height"]
    assert list(document["instances"][0]) == (
        [
            "id",
            "kind",
            "model",
            "pose",
            "velocity_mps",
            "yaw_rate_radps",
            "length_m",
            "width_m",
            "height_m",
            "scale",
            "paint",
        ]
    )
    assert document["ego"]["pose"][3] == [0, 0, 0, 1]
    assert "-0.0," not in _frame().to_json()


def test_a_drive_with_several_worlds_names_the_frames_own(tmp_path: Path) -> None:
    frame = TwinFrame(**vars(_frame()) | {"static": "worlds/grid.glb"})
    write_frame(tmp_path / "a.json", frame)
    assert json.loads((tmp_path / "a.json").read_text())["static"] == "worlds/grid.glb"
    assert read_frame(tmp_path / "a.json").static == "worlds/grid.glb"
    assert read_frame(tmp_path / "a.json").instances[0].id == "veh0"


def _mirrored() -> list[list[float]]:
    return np.diag([1.0, -1, 1, 1]).tolist()


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (("sweep_s",), 0, "sweep_s is 0; expected a number above 0"),
        (("time_s",), "soon", "time_s is 'soon'; expected a finite number"),
        (("ego", "pose"), [[1, 2], [3, 4]], "ego: pose is .* expected numbers of shape 4 × 4"),
        (("ego", "pose"), [[1, 2], [3]], "expected numbers of shape 4 × 4"),
        (("ego", "pose"), _mirrored(), "ego: pose is .* expected a rotation, a translation"),
        (("ego", "velocity_mps"), [1, 2, None], "velocity_mps is .* expected numbers of shape 3"),
        (("ego", "velocity_mps"), [1, 2, float("nan")], "expected finite numbers"),
        (("ego",), [], r"ego: expected an object, found \[\]"),
        (("instances",), {}, "instances is {}; expected a list"),
        (("instances", 1, "model"), "../x", r"instances\[1\]: model is '\.\./x'; expected a plain file name"),
        (("instances", 2, "length_m"), -1, r"instances\[2\]: length_m is -1; expected a number above 0"),
        (("cameras", "image_0", "P"), [1, 2, 3], "cameras: image_0: P is .* expected numbers of shape 3 × 4"),
        (("static",), "/etc/passwd", "static is '/etc/passwd'; expected a relative path"),
    ],
)
def test_faults_name_file_key_value_and_rule(
    tmp_path: Path, place: tuple[str | int, ...], value: object, message: str
) -> None:
    document = json.loads(_frame().to_json())
    target = document
    for key in place[:-1]:
        target = target[key]
    target[place[-1]] = value
    (tmp_path / "a.json").write_text(json.dumps(document))
    with pytest.raises(FormatError, match=rf"a\.json: .*{message}"):
        read_frame(tmp_path / "a.json")


def test_missing_keys_and_broken_json_are_named(tmp_path: Path) -> None:
    document = json.loads(_frame().to_json())
    del document["lidar"]["pattern"]
    with pytest.raises(FormatError, match="lidar: missing 'pattern'; it has pose_ego"):
        TwinFrame.from_json(json.dumps(document))
    with pytest.raises(FormatError, match="not readable as JSON"):
        TwinFrame.from_json("{")
    with pytest.raises(FormatError, match="expected an object"):
        TwinFrame.from_json("[]")


def test_infinite_poses_are_not_written() -> None:
    frame = _frame()
    frame.ego.pose[0, 3] = np.inf
    with pytest.raises(FormatError, match="NaN or infinite"):
        frame.to_json()

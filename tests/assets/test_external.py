"""Foreign meshes come out in our frame, at their measured size, with our materials; broken ones are named."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from hypothesis import given
from hypothesis import strategies as st

from assets import CATALOGUE, MATERIALS, Mesh, build_model
from assets.errors import AssetError
from assets.external import load_external, sort_material
from assets.external.standing import axes_matrix
from cosim.drives.twin import encode_glb

LENGTH, WIDTH, HEIGHT = 4.0, 1.8, 1.5
AXES = ["+x", "-x", "+y", "-y", "+z", "-z"]


def block(low: tuple[float, ...], high: tuple[float, ...]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def car_parts() -> dict[str, trimesh.Trimesh]:
    """A car of blocks in our frame: the nose is low, so that front and rear differ; wheels at x = 1.2 and −1.3."""
    parts = {
        "Body_Paint": block((-2.0, -0.9, 0.3), (2.0, 0.9, 0.8)),
        "WindScreen": block((-1.5, -0.8, 0.8), (0.5, 0.8, 1.5)),
    }
    wheels = [block((x - 0.3, y - 0.1, 0.0), (x + 0.3, y + 0.1, 0.6)) for x in (1.2, -1.3) for y in (0.7, -0.7)]
    parts["TireRubber"] = trimesh.util.concatenate(wheels)
    return parts


def turned(parts: dict[str, trimesh.Trimesh], matrix: np.ndarray) -> dict[str, trimesh.Trimesh]:
    pose = np.eye(4)
    pose[:3, :3] = matrix
    return {name: part.copy().apply_transform(pose) for name, part in parts.items()}


def write_obj(path: Path, parts: dict[str, trimesh.Trimesh]) -> None:
    lines, base = [], 1
    for name, part in parts.items():
        lines.append(f"usemtl {name}")
        lines += ["v " + " ".join(map(repr, map(float, vertex))) for vertex in part.vertices]
        lines += ["f " + " ".join(f"{index + base}/1/1" for index in face) for face in part.faces]
        base += len(part.vertices)
    path.write_text("\n".join(lines) + "\n")


def write_gltf(path: Path, parts: dict[str, trimesh.Trimesh]) -> None:
    """Y up and facing +z, as the standard says: our (x, y, z) is (y, z, x) there."""
    scene = trimesh.Scene()
    for name, part in turned(parts, np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])).items():
        part.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name=name))
        scene.add_geometry(part, node_name=f"node {name}")
    if path.suffix == ".glb":
        path.write_bytes(scene.export(file_type="glb"))
    else:
        for name, data in scene.export(file_type="gltf").items():
            (path.parent / (path.name if name == "model.gltf" else name)).write_bytes(data)


def write_dae(path: Path, parts: dict[str, trimesh.Trimesh], up: str = "Z_UP", unit: float = 1.0) -> None:
    effects, materials, shapes, nodes = [], [], [], []
    for row, (name, part) in enumerate(parts.items()):
        effects.append(
            f'<effect id="e{row}"><profile_COMMON><technique sid="t"><phong/></technique></profile_COMMON></effect>'
        )
        materials.append(f'<material id="m{row}" name="{name}"><instance_effect url="#e{row}"/></material>')
        positions = " ".join(f"{value!r}" for value in map(float, (part.vertices / unit).ravel()))
        faces = " ".join(map(str, part.faces.ravel()))
        shapes.append(
            f'<geometry id="g{row}"><mesh><source id="s{row}"><float_array id="a{row}" count="{part.vertices.size}">'
            f'{positions}</float_array><technique_common><accessor source="#a{row}" count="{len(part.vertices)}" '
            'stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>'
            f'</accessor></technique_common></source><vertices id="v{row}"><input semantic="POSITION" '
            f'source="#s{row}"/></vertices><triangles count="{len(part.faces)}" material="sym">'
            f'<input semantic="VERTEX" source="#v{row}" '
            f'offset="0"/><p>{faces}</p></triangles></mesh></geometry>'
        )
        nodes.append(
            f'<node><instance_geometry url="#g{row}"><bind_material><technique_common><instance_material symbol="sym" '
            f'target="#m{row}"/></technique_common></bind_material></instance_geometry></node>'
        )
    path.write_text(
        '<?xml version="1.0" encoding="utf-8"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" '
        f'version="1.4.1"><asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>'
        f'<unit meter="{unit}" name="u"/><up_axis>{up}</up_axis></asset>'
        f"<library_effects>{''.join(effects)}</library_effects><library_materials>{''.join(materials)}"
        f"</library_materials><library_geometries>{''.join(shapes)}</library_geometries><library_visual_scenes>"
        f'<visual_scene id="scene">{"".join(nodes)}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#scene"/></scene></COLLADA>'
    )


def manifest(folder: Path, *entries: dict) -> Path:
    (folder / "vehicles.yaml").write_text(yaml.safe_dump(list(entries)))
    return folder


def assert_is_the_car(mesh: Mesh) -> None:
    size = (LENGTH, WIDTH, HEIGHT)
    np.testing.assert_allclose(mesh.bounds, [[-2.0, -0.9, 0.0], [2.0, 0.9, 1.5]], atol=1e-5)
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), size, atol=1e-5)
    assert mesh.material_names() == ["car_paint", "car_glass", "tyre"]
    glass = mesh.split_glass()[1]
    np.testing.assert_allclose(glass.bounds[:, 0], [-1.5, 0.5], atol=1e-5)
    outward = np.einsum("ij,ij->i", mesh.normals, mesh.triangles.mean(1) - [0, 0, 0.5])
    assert outward[mesh.triangles[..., 2].min(1) > 1.4].min() > 0, "the roof faces up"


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".obj", ".dae"])
def test_every_format_gives_the_same_car(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"car{suffix}"
    entry = {"file": file.name, "kind": "car"}
    if suffix in (".glb", ".gltf"):
        write_gltf(file, car_parts())
    elif suffix == ".obj":
        write_obj(file, car_parts())
        entry |= {"forward": "x", "up": "z"}
    else:
        write_dae(file, car_parts(), unit=0.01)
        entry |= {"forward": "x"}
    models = load_external(manifest(tmp_path, entry))
    assert_is_the_car(models.meshes["car"])


@given(forward=st.sampled_from(AXES), up=st.sampled_from(AXES))
def test_axes_give_a_rotation_that_carries_them_to_ours(forward: str, up: str) -> None:
    if forward[1] == up[1]:
        with pytest.raises(ValueError, match="same axis"):
            axes_matrix(forward, up)
        return
    matrix = axes_matrix(forward, up)
    assert math.isclose(np.linalg.det(matrix), 1.0)
    sign = {"+": 1.0, "-": -1.0}
    axis = {letter: np.eye(3)[row] for row, letter in enumerate("xyz")}
    np.testing.assert_allclose(matrix @ (sign[forward[0]] * axis[forward[1]]), [1, 0, 0])
    np.testing.assert_allclose(matrix @ (sign[up[0]] * axis[up[1]]), [0, 0, 1])


@pytest.mark.parametrize(("forward", "up"), [("-y", "z"), ("+z", "y"), ("-z", "+y"), ("y", "-x")])
def test_axes_of_the_manifest_turn_the_mesh_upright(tmp_path: Path, forward: str, up: str) -> None:
    to_file = axes_matrix(forward, up).T
    write_obj(tmp_path / "car.obj", turned(car_parts(), to_file))
    folder = manifest(tmp_path, {"file": "car.obj", "class": "car", "forward": forward, "up": up})
    assert_is_the_car(load_external(folder).meshes["car"])


def test_axles_are_where_the_tyres_touch_the_road(tmp_path: Path) -> None:
    parts = car_parts()
    spare = block((-2.05, -0.3, 0.7), (-1.95, 0.3, 1.2))
    parts["TireRubber"] = trimesh.util.concatenate([parts["TireRubber"], spare])
    write_gltf(tmp_path / "car.glb", parts)
    spec = load_external(manifest(tmp_path, {"file": "car.glb", "kind": "car"})).specs["car"]
    shift = 0.025  # the spare wheel moves the box's centre back
    assert spec.front_axle_x_m == pytest.approx(1.2 + shift, abs=1e-5)
    assert spec.rear_axle_x_m == pytest.approx(-1.3 + shift, abs=1e-5)
    assert spec.wheelbase_m == pytest.approx(2.5, abs=1e-5)
    assert spec.track_m == pytest.approx(1.4, abs=1e-5)


def test_without_tyres_axles_follow_the_proportions_of_the_kind(tmp_path: Path) -> None:
    parts = {"Body": block((-2.0, -0.9, 0.0), (2.0, 0.9, 1.5))}
    write_gltf(tmp_path / "car.glb", parts)
    spec = load_external(manifest(tmp_path, {"file": "car.glb", "kind": "car"})).specs["car"]
    assert 0.5 < spec.wheelbase_m / spec.length_m < 0.75
    assert -2 < spec.rear_axle_x_m < 0 < spec.front_axle_x_m < 2
    assert 0.7 < spec.track_m / spec.width_m < 1


@pytest.mark.parametrize("name", ["hatchback_01", "truck_01", "bus_01", "bicycle_01", "motorcycle_01"])
def test_a_catalogue_model_written_and_read_is_the_same_vehicle(tmp_path: Path, name: str) -> None:
    mesh, spec = build_model(name), CATALOGUE[name]
    (tmp_path / "own.glb").write_bytes(encode_glb(mesh, name))
    folder = manifest(tmp_path, {"file": "own.glb", "kind": spec.kind, "forward": "x"})
    models = load_external(folder)
    again, report = models.meshes["own"], models.specs["own"]
    np.testing.assert_allclose(again.bounds, mesh.bounds, atol=1e-4)
    assert again.material_names() == mesh.material_names()
    assert report.front_axle_x_m == pytest.approx(spec.front_axle_x_m, abs=0.05)
    assert report.track_m == pytest.approx(spec.track_m, abs=0.1)


def test_given_dimensions_win_and_the_rest_follow_in_proportion(tmp_path: Path) -> None:
    write_gltf(tmp_path / "car.glb", car_parts())
    entry = {"file": "car.glb", "kind": "car"}
    longer = load_external(manifest(tmp_path, entry | {"length_m": 5.0})).specs["car"]
    np.testing.assert_allclose(longer.size_m, np.array([LENGTH, WIDTH, HEIGHT]) * 1.25, rtol=1e-5)
    all_three = {"length_m": 4.4, "width_m": 1.7, "height_m": 1.6}
    exact = load_external(manifest(tmp_path, entry | all_three)).specs["car"]
    np.testing.assert_allclose(exact.size_m, (4.4, 1.7, 1.6), rtol=1e-5)


def test_models_serve_sizes_within_a_quarter_of_their_own(tmp_path: Path) -> None:
    write_gltf(tmp_path / "car.glb", car_parts())
    models = load_external(manifest(tmp_path, {"file": "car.glb", "kind": "car"}))
    own = np.array([LENGTH, WIDTH, HEIGHT])
    assert [spec.name for spec in models.of_size("car", own * 1.2)] == ["car"]
    assert not models.of_size("car", own * 1.3)
    assert not models.of_size("van", own)


def test_no_folder_means_no_models() -> None:
    assert not load_external(None).specs


@pytest.mark.parametrize(
    ("material", "names"),
    [
        ("car_glass", "Window window_L Windshield wind_screen WindScreen Fensterglas GLASS.001 BMWGlass Glass_Door"),
        ("tyre", "TireRubber Tyre tires_01 Reifen"),
        ("number_plate", "LicensePlate number_plate Kennzeichen plate2"),
        ("headlamp", "HeadLight HeadlightGlass head_lamp"),
        ("tail_lamp", "TailLight tail_light_R Rücklicht"),
        ("car_paint", "CarPaint body_red Paint_LightGrey"),
        ("car_interior", "Interior dashboard steering_wheel"),
        ("car_seat", "SeatLeather"),
        ("car_trim", "WindowFrame RubberSeal black_plastic"),
        ("cargo_box", "GlassContainer GlassBottle"),
    ],
)
def test_names_are_sorted_by_their_last_recognised_word(material: str, names: str) -> None:
    assert {name: sort_material(name) for name in names.split()} == dict.fromkeys(names.split(), material)


@pytest.mark.parametrize("name", ["Material.001", "Hourglass", "Platelet", "Primer", "", "Windowless", "trimaran"])
def test_words_within_words_do_not_count(name: str) -> None:
    assert sort_material(name) is None


@given(name=st.sampled_from(sorted(MATERIALS)))
def test_names_of_the_table_stand_for_themselves(name: str) -> None:
    assert sort_material(name) == name


def test_the_manifest_can_name_materials_itself(tmp_path: Path) -> None:
    parts = car_parts()
    parts["Mat7"] = parts.pop("WindScreen")
    write_gltf(tmp_path / "car.glb", parts)
    folder = manifest(tmp_path, {"file": "car.glb", "kind": "car", "materials": {"Mat7": "car_glass"}})
    assert "car_glass" in load_external(folder).meshes["car"].material_names()


def refused(folder: Path, *entries: dict) -> str:
    with pytest.raises(AssetError) as caught:
        load_external(manifest(folder, *entries))
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_faults_of_the_manifest_are_reported_in_one_line(tmp_path: Path) -> None:
    write_gltf(tmp_path / "car.glb", car_parts())
    good = {"file": "car.glb", "kind": "car"}
    assert "absent.glb: no such mesh" in refused(tmp_path, good | {"file": "absent.glb"})
    assert "unknown key" in refused(tmp_path, good | {"colour": "red"})
    assert "leaves the folder" in refused(tmp_path, good | {"file": "../car.glb"})
    assert "leaves the folder" in refused(tmp_path, good | {"file": "/etc/passwd.glb"})
    assert "export it as .glb" in refused(tmp_path, good | {"file": "car.pkl"})
    assert "kind" in refused(tmp_path, good | {"kind": "spaceship"})
    assert "same axis" in refused(tmp_path, good | {"forward": "x", "up": "-x"})
    assert "another name" in refused(tmp_path, good, good)
    assert "built-in" in refused(tmp_path, good | {"name": "hatchback_01"})
    assert "not in the table" in refused(tmp_path, good | {"materials": {"a": "unobtainium"}})
    assert "define up" in refused(tmp_path, good | {"file": "car.obj"})
    assert "greater than 0" in refused(tmp_path, good | {"length_m": -1})
    assert "wider than long" in refused(tmp_path, good | {"forward": "x"})
    assert "unit_m" in refused(tmp_path, good | {"unit_m": 0.01})


def test_a_folder_without_a_manifest_says_what_it_lacks(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match=r"vehicles\.yaml"):
        load_external(tmp_path)
    (tmp_path / "vehicles.yaml").write_text("file: car.glb\n")
    with pytest.raises(AssetError, match="no list"):
        load_external(tmp_path)


OBJ = {"file": "x.obj", "kind": "car", "forward": "x", "up": "z"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 1\n", "no faces"),
        ("", "no faces"),
        ("v 0 0 0\nv 4 nan 0\nv 0 1 1\nf 1 2 3\n", "NaN or infinite"),
        ("v 0 0 0\nv 4 inf 0\nv 0 1 1\nf 1 2 3\n", "NaN or infinite"),
        ("v 0 0 0\nv 4 0 0\nv 0 2 0\nf 1 2 3\n", "flat"),
        ("v 0 0 0\nv 4 0 0\nv 0 2 0\nf 1 2 9\n", "line 4"),
        ("v 0 0\nf 1 1 1\n", "line 1"),
        ("v a b c\n", "line 1"),
    ],
)
def test_broken_meshes_are_named(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "x.obj").write_text(text)
    message = refused(tmp_path, OBJ)
    assert said in message
    assert "x.obj" in message


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".dae"])
def test_bytes_that_are_no_mesh_are_refused(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"x{suffix}").write_bytes(b"\x80\x04\x95 not a mesh")
    assert f"x{suffix}" in refused(tmp_path, {"file": f"x{suffix}", "kind": "car", "forward": "x"})


def test_entities_in_collada_are_refused(tmp_path: Path) -> None:
    (tmp_path / "x.dae").write_text('<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><COLLADA/>')
    assert "DOCTYPE" in refused(tmp_path, {"file": "x.dae", "kind": "car", "forward": "x"})


def test_links_out_of_the_folder_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "vehicles"
    folder.mkdir()
    write_obj(tmp_path / "secret.obj", car_parts())
    (folder / "x.obj").symlink_to(tmp_path / "secret.obj")
    assert "leads out" in refused(folder, OBJ)


def test_a_gltf_cannot_open_files_elsewhere(tmp_path: Path) -> None:
    folder = tmp_path / "vehicles"
    folder.mkdir()
    write_gltf(folder / "x.gltf", car_parts())
    for buffer in folder.glob("*.bin"):
        buffer.rename(tmp_path / buffer.name)
        text = (folder / "x.gltf").read_text().replace(buffer.name, f"../{buffer.name}")
        (folder / "x.gltf").write_text(text)
    assert "x.gltf" in refused(folder, {"file": "x.gltf", "kind": "car"})


def test_polygons_and_backward_indices_of_obj_are_read(tmp_path: Path) -> None:
    lines = [f"v {x} {y} {z}" for z in (0, 1.5) for x, y in ((2, 0.9), (-2, 0.9), (-2, -0.9), (2, -0.9))]
    (tmp_path / "x.obj").write_text("\n".join([*lines, "f 4 3 2 1", "f -4 -3 -2 -1", "f 1 2 6 5"]) + "\n")
    mesh = load_external(manifest(tmp_path, OBJ)).meshes["x"]
    assert len(mesh.faces) == 6
    np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0), (4, 1.8, 1.5))


def test_vertices_that_no_face_uses_may_lie_anywhere(tmp_path: Path) -> None:
    write_obj(tmp_path / "model.obj", car_parts())
    text = (tmp_path / "model.obj").read_text()
    (tmp_path / "model.obj").write_text(text + "v 1e300 0 0\n")
    entry = {"file": "model.obj", "kind": "car", "forward": "+x", "up": "+z"}
    spec = load_external(manifest(tmp_path, entry)).specs["model"]
    np.testing.assert_allclose(spec.size_m, (LENGTH, WIDTH, HEIGHT), atol=1e-6)

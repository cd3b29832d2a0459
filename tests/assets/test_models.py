import inspect
from functools import cache

import numpy as np
import pytest

from assets.materials import MATERIALS, material_index
from assets.mesh import Mesh
from assets.models import CATALOGUE, ModelSpec, build_model
from assets.models.pedestrian import HIP_BEHIND, SEAT_M
from tests.assets.rays import first_hits

NAMES = sorted(CATALOGUE)
CARS = [name for name in NAMES if CATALOGUE[name].kind == "car"]
WHEELED = [name for name in NAMES if CATALOGUE[name].wheelbase_m > 0]
LICENSED = [name for name in NAMES if CATALOGUE[name].kind in ("car", "van", "truck", "bus")]

TRAMS = [name for name in NAMES if CATALOGUE[name].kind == "tram"]
SITTING = [name for name in NAMES if CATALOGUE[name].kind == "person_sitting"]

model = cache(build_model)


def part(mesh: Mesh, material: str) -> Mesh:
    return mesh.select(mesh.materials == material_index(material))


def panes(glass: Mesh) -> list[np.ndarray]:
    """Face rows of each connected sheet of glass."""
    keys = np.unique(glass.vertices.round(4), axis=0, return_inverse=True)[1].reshape(-1)
    label = np.arange(keys.max() + 1)
    faces = keys[glass.faces]
    while True:
        low = label[faces].min(1)
        spread = label.copy()
        np.minimum.at(spread, faces.reshape(-1), np.repeat(low, 3))
        if (spread == label).all():
            return [np.flatnonzero(label[faces[:, 0]] == root) for root in np.unique(label[faces[:, 0]])]
        label = spread


def side_rays(spec: ModelSpec, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Rays from 5 m to the left, across the middle half of the length, heights as shares of the height."""
    x, z = np.meshgrid(
        np.linspace(-0.25, 0.25, 60) * spec.length_m, np.linspace(low, high, 12) * spec.height_m, indexing="ij"
    )
    return np.stack([x, np.full_like(x, 5.0), z], -1).reshape(-1, 3), np.array([0.0, -1.0, 0.0])


@pytest.mark.parametrize("name", NAMES)
def test_a_model_fills_its_box_exactly(name):
    spec = CATALOGUE[name]
    half = np.array([spec.length_m / 2, spec.width_m / 2], np.float32)
    low, high = model(name).bounds
    assert (low == np.array([-half[0], -half[1], 0.0], np.float32)).all()
    assert (high == np.array([half[0], half[1], spec.height_m], np.float32)).all()


@pytest.mark.parametrize("name", NAMES)
def test_every_face_has_an_area_and_a_normal(name):
    a, b, c = np.moveaxis(model(name).triangles.astype(float), 1, 0)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() > 1e-9
    assert np.linalg.norm(model(name).normals, axis=1) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_a_model_is_light_enough_to_build_and_draw(name):
    assert 800 <= len(model(name).faces) <= 5200


@pytest.mark.parametrize("name", NAMES[::5])
def test_the_same_name_gives_the_same_bytes(name):
    again = inspect.unwrap(build_model)(name)
    for field in ("vertices", "faces", "materials"):
        assert getattr(again, field).tobytes() == getattr(model(name), field).tobytes()


@pytest.mark.parametrize("name", NAMES)
def test_surfaces_face_outwards(name):
    mesh, spec = model(name), CATALOGUE[name]
    opaque, glass = mesh.split_glass()
    rng = np.random.default_rng(0)
    towards = rng.normal(size=(4000, 3)) * (1, 1, 0.3)
    towards[:, 2] = np.abs(towards[:, 2])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    target = (rng.random((4000, 3)) - (0.5, 0.5, 0.0)) * spec.size_m
    distance, face = first_hits(opaque, target + 20 * towards, -towards)
    if len(glass.faces):
        face = np.where(first_hits(glass, target + 20 * towards, -towards)[0] < distance, -1, face)
    seen = face >= 0
    turned_away = np.einsum("ij,ij->i", opaque.normals[face[seen]], towards[seen]) < -1e-3
    assert turned_away.mean() < 0.005


@pytest.mark.parametrize("name", WHEELED)
def test_tyres_touch_the_ground_under_each_axle(name):
    spec = CATALOGUE[name]
    tyre = part(model(name), "tyre").vertices
    contact = tyre[tyre[:, 2] < 2e-3]
    for axle in (spec.front_axle_x_m, spec.rear_axle_x_m):
        near = contact[np.abs(contact[:, 0] - axle) < 0.03 * spec.length_m]
        assert len(near)
        assert (near[:, 1].min() < -0.4 * spec.track_m) == (near[:, 1].max() > 0.4 * spec.track_m)


@pytest.mark.parametrize("name", LICENSED)
def test_retroreflecting_plates_of_standard_size_face_front_and_rear(name):
    plates = part(model(name), "number_plate")
    assert MATERIALS["number_plate"].retro
    for way in (1, -1):
        face = plates.select(way * plates.normals[:, 0] > 0.99)
        face = face.select(way * face.triangles[:, :, 0].mean(1) > 0)
        size = np.ptp(face.vertices[way * face.vertices[:, 0] >= (way * face.vertices[:, 0]).max() - 0.002], axis=0)
        assert size[1:] == pytest.approx([0.52, 0.11], rel=0.05)


@pytest.mark.parametrize("name", LICENSED)
def test_a_plate_is_the_first_thing_a_beam_along_the_road_meets(name):
    mesh = model(name)
    plates = part(mesh, "number_plate")
    for way in (1, -1):
        middle = plates.vertices[way * plates.vertices[:, 0] > 0].mean(0, dtype=float)
        _, face = first_hits(mesh, np.array([[way * 20.0, 0.1, middle[2]]]), np.array([-way, 0.0, 0.0]))
        assert mesh.materials[face[0]] == material_index("number_plate")


@pytest.mark.parametrize("name", [*LICENSED, *TRAMS])
def test_headlamps_look_forward_and_tail_lamps_back(name):
    for material, way in (("headlamp", 1), ("tail_lamp", -1)):
        lamps = part(model(name), material)
        assert (way * lamps.vertices[:, 0] > 0).all()
        assert {-1.0, 1.0} <= set(np.sign(lamps.vertices[:, 1]))
        assert (way * lamps.normals[:, 0] > 0.3).any()


@pytest.mark.parametrize(
    ("body", "least"),
    [
        *(("hatchback", 6), ("saloon", 6), ("estate", 8), ("suv", 8), ("van", 3), ("truck", 3), ("bus", 14)),
        ("tram", 14),
    ],
)
def test_a_body_has_its_windows(body, least):
    for name in (name for name in NAMES if CATALOGUE[name].body == body):
        assert len(panes(model(name).split_glass()[1])) >= least


@pytest.mark.parametrize("name", LICENSED)
def test_glass_is_open_sheets_never_a_closed_solid(name):
    glass = model(name).split_glass()[1]
    keys = np.unique(glass.vertices.round(4), axis=0, return_inverse=True)[1].reshape(-1)
    for rows in panes(glass):
        faces = keys[glass.faces[rows]]
        edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        assert (np.unique(edges, axis=0, return_counts=True)[1] == 1).any()


@pytest.mark.parametrize("name", LICENSED)
def test_nothing_opaque_lies_on_or_close_behind_a_pane(name):
    opaque, glass = model(name).split_glass()
    middle = glass.triangles.mean(1)
    distance, _ = first_hits(opaque, middle + 0.002 * glass.normals, -glass.normals)
    assert (distance > 0.02).all()


@pytest.mark.parametrize("name", CARS)
def test_a_beam_through_a_side_window_reaches_the_interior_or_leaves_on_the_other_side(name):
    mesh, spec = model(name), CATALOGUE[name]
    origins, direction = side_rays(spec, 0.70, 0.86)
    opaque, glass = mesh.split_glass()
    to_glass, _ = first_hits(glass, origins, direction)
    to_solid, face = first_hits(opaque, origins, direction)
    through = to_glass < to_solid
    assert through.mean() > 0.4
    assert np.isinf(to_solid[through]).mean() > 0.1
    inside = face[through & np.isfinite(to_solid)]
    soft = [material_index(material) for material in ("car_interior", "car_seat", "car_trim")]
    assert np.isin(opaque.materials[inside], soft).mean() > 0.5


@pytest.mark.parametrize("name", CARS)
def test_a_beam_through_the_windscreen_falls_on_the_interior(name):
    mesh, spec = model(name), CATALOGUE[name]
    y, z = np.meshgrid(np.linspace(-0.25, 0.25, 20) * spec.width_m, np.linspace(1.6, 2.2, 12), indexing="ij")
    origins = np.stack([np.full_like(y, 8.0), y, z], -1).reshape(-1, 3)
    direction = np.array([-0.985, 0.0, -0.13])
    opaque, glass = mesh.split_glass()
    to_glass, _ = first_hits(glass, origins, direction)
    to_solid, face = first_hits(opaque, origins, direction)
    through = (to_glass < to_solid) & np.isfinite(to_solid)
    assert through.sum() > 20
    soft = [material_index(material) for material in ("car_interior", "car_seat", "car_trim")]
    assert np.isin(opaque.materials[face[through]], soft).mean() > 0.8


@pytest.mark.parametrize("name", CARS)
def test_the_underside_is_closed_and_clear_of_the_road(name):
    mesh, spec = model(name), CATALOGUE[name]
    x, y = np.meshgrid(
        np.linspace(-0.48, 0.48, 80) * spec.length_m, np.linspace(-0.38, 0.38, 30) * spec.width_m, indexing="ij"
    )
    origins = np.stack([x, y, np.full_like(x, -1.0)], -1).reshape(-1, 3)
    distance, face = first_hits(mesh, origins, np.array([0.0, 0.0, 1.0]))
    assert (face >= 0).mean() > 0.97
    below = [material_index(name) for name in ("underbody", "tyre", "car_trim", "wheel_rim", "car_paint")]
    assert np.isin(mesh.materials[face[face >= 0]], below).mean() > 0.99
    underbody = distance[(face >= 0) & (mesh.materials[face] == material_index("underbody"))] - 1.0
    assert underbody.min() > 0.13


@pytest.mark.parametrize("name", CARS)
def test_a_car_is_its_own_mirror_image(name):
    mesh = model(name)
    for material in ("car_paint", "car_glass", "tyre", "wheel_rim", "mirror", "headlamp", "tail_lamp"):
        points = part(mesh, material).vertices.astype(float)
        points = np.unique(points.round(3) + 0.0, axis=0)
        images = np.unique((points * (1, -1, 1)).round(3) + 0.0, axis=0)
        assert len(points) == len(images)
        assert np.abs(points - images).max() < 2e-3


@pytest.mark.parametrize("name", CARS)
def test_a_car_narrows_upwards_and_towards_its_ends(name):
    mesh, spec = model(name), CATALOGUE[name]
    points = part(mesh, "car_paint").vertices
    roof = np.abs(points[points[:, 2] > 0.93 * spec.height_m, 1]).max()
    flank = np.abs(points[np.abs(points[:, 2] - 0.4 * spec.height_m) < 0.1, 1]).max()
    assert 0.6 < roof / flank < 0.9
    nose = np.abs(points[points[:, 0] > 0.47 * spec.length_m, 1]).max()
    assert nose < 0.97 * flank


@pytest.mark.parametrize("name", TRAMS)
def test_skirts_of_a_tram_hide_its_bogies(name):
    spec = CATALOGUE[name]
    x = np.concatenate([np.linspace(axle - 0.4, axle + 0.4, 30) for axle in (spec.front_axle_x_m, spec.rear_axle_x_m)])
    _, face = first_hits(model(name), np.column_stack([x, np.full(60, 5.0), np.full(60, 0.34)]), np.array([0, -1.0, 0]))
    assert (model(name).materials[face] != material_index("tyre")).all()
    assert spec.track_m == 1.435


@pytest.mark.parametrize("name", SITTING)
def test_a_person_that_sits_is_supported_at_the_height_of_a_seat(name):
    mesh, spec = model(name), CATALOGUE[name]
    hips = -HIP_BEHIND * spec.length_m
    legs = part(mesh, "clothing_dark").vertices
    seat = legs[(np.abs(legs[:, 0] - hips) < 0.12) & (np.abs(legs[:, 1]) < 0.2)]
    assert seat[:, 2].min() == pytest.approx(SEAT_M, abs=0.06)
    assert part(mesh, "shoe").vertices[:, 0].min() > hips + 0.15

import numpy as np
import pytest

from assets import shapes
from assets.mesh import Mesh

TURN = 2 * np.pi * np.arange(48) / 48
SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
HOLE = np.array([[0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [0.5, 1.5]])
CIRCLE = np.stack([np.cos(TURN), np.sin(TURN), 0 * TURN], 1)

SOLIDS = {
    "box": (shapes.box((1, 2, 3), (4, 5, 6), "kerb"), 6.0),
    "cylinder along x": (shapes.cylinder(1, 2, "kerb", 48, "x"), 2 * np.pi),
    "cylinder along y": (shapes.cylinder(1, 2, "kerb", 48, "y"), 2 * np.pi),
    "cone": (shapes.cone(1, 0, 3, "kerb", 48), np.pi),
    "ellipsoid": (shapes.ellipsoid((1, 2, 3), (1, 1, 1), "kerb", 48, 32), 8 * np.pi),
    "prism with a hole": (shapes.extrude(SQUARE, 2, "kerb", [HOLE]), 6.0),
    "prism of a clockwise outline": (shapes.extrude(SQUARE[::-1], 2, "kerb", axis="y"), 8.0),
    "loft": (shapes.loft(np.stack([CIRCLE, CIRCLE + np.array([0, 0, 2])]), "kerb"), 2 * np.pi),
    "tube": (shapes.tube(np.array([[0, 0, 0], [0, 0, 1.0]]), 0.5, "kerb", 48), np.pi / 4),
    "ring": (shapes.tube(2 * CIRCLE, 0.5, "kerb", 48, closed=True), np.pi**2),
}


def volume(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.triangles.astype(float), 1, 0)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_encloses_its_volume_with_outward_faces(name):
    mesh, expected = SOLIDS[name]
    assert volume(mesh) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("name", SOLIDS)
def test_every_edge_of_a_solid_is_shared_by_two_opposite_faces(name):
    faces = SOLIDS[name][0].faces
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = {tuple(edge) for edge in edges.tolist()}
    assert len(forward) == len(edges)
    assert forward == {(b, a) for a, b in forward}


def test_a_plate_faces_up_and_keeps_its_hole_open():
    plate = shapes.plate(SQUARE, "kerb", 0.3, [HOLE])
    assert (plate.normals[:, 2] > 0.999).all()
    a, b, c = np.moveaxis(plate.triangles, 1, 0)
    assert 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() == pytest.approx(3.0)


def test_mirroring_keeps_faces_outward():
    solid = SOLIDS["prism with a hole"][0]
    assert volume(shapes.mirrored(solid)) == pytest.approx(volume(solid))


def test_turning_about_an_axis_is_right_handed():
    pose = shapes.rotation("z", np.pi / 2, (1, 0, 0))
    assert pose @ [1, 0, 0, 1] == pytest.approx([1, 1, 0, 1])
    assert shapes.rotation("y", np.pi / 2) @ [0, 0, 1, 1] == pytest.approx([1, 0, 0, 1])

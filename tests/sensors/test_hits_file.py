import numpy as np
import pytest

from assets.mesh import Mesh
from sensors.errors import SensorError
from sensors.hits_file import encode_hits, load_hits
from sensors.normals import decode_normals, encode_normals
from sensors.pattern import load_pattern
from sensors.scene import Scene
from sensors.tracing import Tracer
from tests.sensors.worlds import block, instances, plane, pose, wall


@pytest.fixture(scope="module")
def hits():
    pattern = load_pattern("hdl64e")
    world = Scene(Mesh.merge([plane(), wall(30.0), wall(12.0, "window_glass", 2.0)]), lambda name: block((4, 2, 1.5)))
    return Tracer(pattern.rays(), pattern.range_m).trace(world, pose(z=1.73), instances([pose(8.0, 4.0), pose(-9.0)]))


def test_stored_hits_are_read_back_without_loss(hits, tmp_path):
    path = tmp_path / "000000.npz"
    path.write_bytes(encode_hits(hits))
    again = load_hits(path, hits.rays)
    for name in ("solid", "pane"):
        for column in ("range_m", "normal_code", "material", "instance"):
            np.testing.assert_array_equal(getattr(getattr(again, name), column), getattr(getattr(hits, name), column))
    np.testing.assert_array_equal(again.pane_beam, hits.pane_beam)
    np.testing.assert_array_equal(again.pose, hits.pose)
    assert (again.reflectance(again.solid) == hits.reflectance(hits.solid)).all()
    assert len(hits.pane_beam)


def test_equal_hits_give_equal_bytes(hits):
    assert encode_hits(hits) == encode_hits(hits)


def test_hits_of_another_pattern_are_refused(hits, tmp_path):
    path = tmp_path / "000000.npz"
    path.write_bytes(encode_hits(hits))
    fewer = load_pattern("hdl64e").model_copy(update={"firings": 100}).rays()
    with pytest.raises(SensorError, match="133312 beams but the pattern has 6400"):
        load_hits(path, fewer)


@pytest.mark.parametrize("damage", [lambda data: b"", lambda data: data[:-40], lambda data: b"no archive" + data[:20]])
def test_damaged_hits_are_refused_in_one_line(hits, tmp_path, damage):
    path = tmp_path / "000000.npz"
    path.write_bytes(damage(encode_hits(hits)))
    with pytest.raises(SensorError) as caught:
        load_hits(path, hits.rays)
    assert "\n" not in str(caught.value) and "000000.npz" in str(caught.value)


def test_normals_survive_their_encoding_to_a_twentieth_of_a_degree():
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(20000, 3))
    normals = np.concatenate([normals, np.eye(3), -np.eye(3)])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    again = decode_normals(encode_normals(normals))
    assert np.degrees(np.arccos(np.einsum("ij,ij->i", normals, again).clip(-1, 1))).max() < 0.06

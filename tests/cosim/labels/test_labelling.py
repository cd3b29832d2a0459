import numpy as np
import pytest

from assets import Mesh
from cosim.drives.kitti.calibration import Calibration
from cosim.labels.labelling import Labeller
from sensors.cameras import KITTI_CALIBRATION
from sensors.scene import Instances, Scene
from tests.sensors.worlds import block, instances, pose

SIZE = (4.0, 1.6, 1.5)
WIDTH, HEIGHT = 1242, 375
CALIBRATION = Calibration(**vars(KITTI_CALIBRATION))
LIDAR = pose(z=1.73)


def placed(*poses: np.ndarray) -> Instances:
    row = instances(list(poses))
    row.sizes[:] = SIZE
    return row


def ideal_image(row: Instances, hidden: slice | None = None) -> np.ndarray:
    """Instance image of boxes drawn by ray casting, nearest last; `hidden` columns show something else."""
    scene = Scene(Mesh.empty(), lambda name: block(SIZE))
    image = np.zeros((HEIGHT, WIDTH), np.int64)
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    P = CALIBRATION.projection(2)
    direction = np.linalg.solve(P[:, :3], np.stack([u.ravel(), v.ravel(), np.ones(u.size)])).T
    centre = -np.linalg.solve(P[:, :3], P[:, 3])
    order = np.argsort(-np.linalg.norm(row.poses[:, :2, 3], axis=1))
    for k in order:
        model = np.linalg.inv(CALIBRATION.velo_to_rect_matrix @ np.linalg.inv(LIDAR) @ row.poses[k])
        origin = np.tile((model[:3, :3] @ centre + model[:3, 3]).astype(np.float32), (u.size, 1))
        turned = (direction @ model[:3, :3].T).astype(np.float32)
        _, triangle = scene.model("block").opaque.first_hit(origin, turned, np.full(u.size, 1e4, np.float32))
        image.ravel()[triangle >= 0] = k + 1
    if hidden is not None:
        image[:, hidden] = 0
    return image


@pytest.fixture(scope="module")
def labeller():
    return Labeller(Scene(Mesh.empty(), lambda name: block(SIZE)), CALIBRATION, range_m=80, min_pixels=20)


def test_a_car_in_sight_is_whole_and_visible(labeller):
    row = placed(pose(20.0, 1.0, 0.0, 0.4))
    labels = labeller.label(row, LIDAR, ideal_image(row))
    assert labels.type == ("Car",)
    assert labels.truncated[0] == 0 and labels.occluded[0] == 0
    boxes = labels.boxes_velo(CALIBRATION)
    np.testing.assert_allclose(boxes.centre[0], [20, 1, 0.75 - 1.73], atol=1e-6)
    np.testing.assert_allclose(boxes.size[0], SIZE)
    assert boxes.yaw[0] == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize(("hidden_share", "occluded"), [(0.0, 0), (0.05, 1), (0.4, 1), (0.6, 2), (0.85, 2)])
def test_occlusion_follows_the_share_of_hidden_pixels(labeller, hidden_share, occluded):
    row = placed(pose(20.0, 0.0))
    whole = ideal_image(row)
    columns = np.flatnonzero((whole > 0).any(0))
    cut = columns[0] + round(hidden_share * len(columns))
    labels = labeller.label(row, LIDAR, ideal_image(row, slice(0, cut)))
    assert labels.occluded.tolist() == [occluded]


def test_the_box_of_what_is_hidden_spans_the_whole_object(labeller):
    row = placed(pose(20.0, 0.0))
    whole = labeller.label(row, LIDAR, ideal_image(row))
    half = labeller.label(row, LIDAR, ideal_image(row, slice(0, 610)))
    np.testing.assert_allclose(half.bbox, whole.bbox)


def test_a_car_half_out_of_the_image_is_truncated(labeller):
    edge = [labels.truncated[0] for labels in (label_at(labeller, 15.0, y) for y in (11.0, 12.0, 13.0))]
    assert 0 < edge[0] < edge[1] < edge[2] < 1


def label_at(labeller, x, y):
    row = placed(pose(x, y))
    return labeller.label(row, LIDAR, ideal_image(row))


def test_what_reaches_behind_the_camera_gets_the_box_of_its_pixels(labeller):
    row = placed(pose(1.2, -2.0))
    image = ideal_image(row)
    labels = labeller.label(row, LIDAR, image)
    v, u = np.nonzero(image)
    np.testing.assert_allclose(labels.bbox[0], [u.min(), v.min(), u.max(), v.max()])
    assert 0.3 < labels.truncated[0] < 1


def test_far_objects_become_dont_care_and_come_last(labeller):
    row = placed(pose(95.0, 0.0), pose(30.0, 4.0))
    labels = labeller.label(row, LIDAR, ideal_image(row))
    assert labels.type == ("Car", "DontCare")
    assert labels.location[1].tolist() == [-1000, -1000, -1000] and labels.truncated[1] == -1
    assert labels.bbox[1, 2] > labels.bbox[1, 0]


def test_what_is_invisible_is_not_labelled(labeller):
    row = placed(pose(30.0, 0.0), pose(-10.0, 0.0))
    labels = labeller.label(row, LIDAR, ideal_image(row, slice(0, WIDTH)))
    assert len(labels) == 0


def test_what_the_scanner_hardly_meets_becomes_dont_care():
    labeller = Labeller(
        Scene(Mesh.empty(), lambda name: block(SIZE)), CALIBRATION, range_m=80, min_pixels=20, min_points=6
    )
    row = placed(pose(30.0, 4.0), pose(60.0, -4.0), pose(20.0, -2.0))
    labels = labeller.label(row, LIDAR, ideal_image(row), np.array([6, 5, 200]))
    assert labels.type == ("Car", "Car", "DontCare")
    np.testing.assert_allclose(sorted(labels.boxes_velo(CALIBRATION).centre[:2, 0]), [20, 30], atol=1e-6)

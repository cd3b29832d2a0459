"""A drive has the configured images, which agree with its labels and its twin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.drives.kitti.drive import Drive
from cosim.drives.kitti.images import read_depth
from sensors.cameras import CLASSES
from tests.cosim.conftest import refused
from tests.sharing import made_once, record

WANTED = ("image_0", "image_1", "image_3", "depth_0", "depth_1", "semantic_2", "instance_2")


@pytest.fixture(scope="module")
def stereo(run_config, tmp_path_factory) -> Drive:
    text = run_config.read_text().replace("frames: 8", "frames: 4").replace("seed: 3", "seed: 6")
    text += f"images: [{', '.join(WANTED)}]\nstore_hits: false\n"
    text += "min_label_points: 0\nannotators: {enabled: false}\n"  # no visible object becomes DontCare

    def make(folder: Path) -> None:
        (folder / "run.yaml").write_text(text)
        record(folder / "run.yaml", folder / "drive")

    return Drive(made_once(tmp_path_factory, "stereo", make) / "drive")


def test_only_what_is_requested_is_there(stereo):
    for product in (f"{kind}_{camera}" for kind in ("image", "depth", "semantic", "instance") for camera in range(4)):
        folder = stereo.root / product
        assert (product in WANTED) == folder.is_dir(), product
        if folder.is_dir():
            assert sorted(path.stem for path in folder.iterdir()) == list(stereo.frames)


def test_gray_cameras_are_gray_and_colour_cameras_see_colour(stereo):
    frame = next(iter(stereo))
    for name in ("image_0", "image_1"):
        assert frame.image(name).ndim == 2
    assert frame.image("image_3").ndim == 3


def test_the_twin_lists_every_camera_with_the_projection_of_the_calibration(stereo):
    for frame in stereo:
        assert sorted(frame.twin.cameras) == ["image_0", "image_1", "image_2", "image_3"]
        for name, camera in frame.twin.cameras.items():
            np.testing.assert_allclose(camera.P, frame.calibration.projection(int(name[-1])), atol=1e-5)
            assert frame.image("image_0").shape == (camera.height, camera.width)


def test_depths_of_both_gray_cameras_tell_of_one_world(stereo):
    """A pixel of camera 0, moved by f·b/z, finds the same depth in camera 1 (where nothing hides it there)."""
    for frame in stereo:
        left, right = (read_depth(frame.path(part)) for part in ("depth_0", "depth_1"))
        shift = frame.calibration.projection(0)[0, 3] - frame.calibration.projection(1)[0, 3]
        v, u = np.nonzero((left > 4) & (left < 60))
        there = np.rint(u - shift / left[v, u]).astype(int)
        inside = there >= 0
        v, u, there = v[inside], u[inside], there[inside]
        assert len(v) > 50_000
        assert np.mean(np.abs(right[v, there] - left[v, u]) < 0.02 * left[v, u]) > 0.9


def test_labels_stand_for_what_the_instance_image_shows(stereo):
    """Exactly the objects with 20 pixels within 80 m are labelled, with their class and a box around their pixels."""
    labelled = 0
    for frame in stereo:
        numbers, classes = frame.instances(), frame.image("semantic_2")
        lidar = frame.twin.ego.pose @ frame.twin.lidar.pose_ego
        shown = {}
        for number, pixels in zip(*np.unique(numbers[numbers > 0], return_counts=True), strict=True):
            instance = frame.twin.instances[int(number) - 1]
            if pixels >= 20 and np.linalg.norm((np.linalg.inv(lidar) @ instance.pose)[:3, 3]) < 78:
                shown[int(number)] = instance
        labels = frame.labels.cared_for
        assert len(labels) >= len(shown) > 0
        for number, instance in shown.items():
            size = (instance.height_m, instance.width_m, instance.length_m)
            v, u = np.nonzero(numbers == number)
            around = (
                (np.abs(labels.dimensions - size).max(1) < 1e-3)
                & (labels.bbox[:, :2] <= np.array([u.min(), v.min()]) + 1.5).all(1)
                & (labels.bbox[:, 2:] >= np.array([u.max(), v.max()]) - 1.5).all(1)
            )
            assert around.any(), (frame.name, instance.id)
            if instance.kind in ("car", "van"):
                assert (classes[v, u] == CLASSES["car"]).all()
                labelled += 1
    assert labelled >= 8


def test_every_pixel_has_a_listed_class(stereo):
    for frame in stereo:
        classes = frame.image("semantic_2")
        assert set(np.unique(classes)) <= set(CLASSES.values())
        assert (classes == CLASSES["road"]).mean() > 0.05 and (classes == CLASSES["sky"]).mean() > 0.05


@pytest.mark.parametrize(
    ("images", "complaint"),
    [("[image_4]", "'image_4' is not an image folder"), ("[depth_0, depth_0]", "is listed twice"), ("7", "images")],
)
def test_an_unknown_image_is_refused_in_one_line(tmp_path: Path, images, complaint):
    config = tmp_path / "run.yaml"
    config.write_text(f"town: town01\nimages: {images}\n")
    assert complaint in refused("run", config, "--out", tmp_path / "drive")

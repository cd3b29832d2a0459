"""What the cameras of KITTI's rig see besides colour: depth by disparity, classes, numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from assets import CATALOGUE, build_model
from assets.materials import MATERIALS, material_index
from assets.mesh import Mesh
from sensors.cameras import CLASSES, KITTI_CALIBRATION, CameraRenderer, Light, kitti_cameras, semantic_image
from sensors.cameras.semantics import MATERIAL_CLASSES
from tests.sensors.test_cameras import cuboid, ground, needs_osmesa
from tests.sensors.worlds import instances, pose

CAMERAS = kitti_cameras(KITTI_CALIBRATION)
EGO_FROM_CAMERA = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.65], [0, 0, 0, 1.0]])


def renderer(static: Mesh) -> CameraRenderer:
    camera = CAMERAS["image_0"]
    return CameraRenderer(static, build_model, Light(), width=camera.width, height=camera.height)


@needs_osmesa
@pytest.mark.parametrize(("left", "right"), [("image_0", "image_1"), ("image_2", "image_3")])
@pytest.mark.parametrize("distance_m", [6.0, 12.0, 30.0])
def test_disparity_on_a_wall_is_focal_length_times_baseline_over_distance(left, right, distance_m):
    half = (1.0, 40.0, 60.0)
    seam = [cuboid(half, (distance_m + 0.5, side * 20.0, 0), name) for side, name in ((1, "brick"), (-1, "concrete"))]
    brick = material_index("brick") + 1
    columns = {}
    with renderer(Mesh.merge(seam)) as world:
        for name in (left, right):
            images = world.render(EGO_FROM_CAMERA, CAMERAS[name].P, instances([]))
            assert np.abs(images.depth_m - distance_m).max() < 1e-3
            columns[name] = np.mean((images.material == brick).sum(1))
    baseline_m = (CAMERAS[left].P[0, 3] - CAMERAS[right].P[0, 3]) / CAMERAS[left].P[0, 0]
    assert baseline_m == pytest.approx(0.54, abs=0.01)
    disparity = columns[left] - columns[right]
    assert disparity == pytest.approx(CAMERAS[left].P[0, 0] * baseline_m / distance_m, abs=1.0)


@needs_osmesa
def test_pixels_have_the_class_of_what_stands_there():
    names = [next(spec.name for spec in CATALOGUE.values() if spec.kind == kind) for kind in ("car", "cyclist")]
    people = replace(
        instances([pose(8.0, 2.0), pose(8.0, -2.0, yaw=np.pi / 2)]), models=tuple(names), kinds=("car", "cyclist")
    )
    with renderer(ground()) as world:
        images = world.render(EGO_FROM_CAMERA, CAMERAS["image_2"].P, people)
    classes = semantic_image(images, people.kinds)
    assert classes.dtype == np.uint8
    assert set(np.unique(classes[images.instance == 1])) == {CLASSES["car"]}
    assert set(np.unique(classes[images.instance == 2])) == {CLASSES["bicycle"], CLASSES["rider"]}
    assert set(np.unique(classes[images.instance == 0])) == {CLASSES["road"], CLASSES["sky"]}
    assert ((classes == CLASSES["sky"]) == (images.depth_m == 0)).all()


@needs_osmesa
def test_the_last_of_65535_keeps_its_number_and_its_material():
    crowd = instances([pose(-50.0)] * 65534 + [pose(10.0)])
    with CameraRenderer(
        Mesh.empty(), {"block": cuboid((2, 2, 4), material="helmet")}, Light(), width=1242, height=375
    ) as world:
        images = world.render(EGO_FROM_CAMERA, CAMERAS["image_0"].P, crowd)
    shown = images.instance > 0
    assert shown.sum() > 1000
    assert (images.instance[shown] == 65535).all()
    assert (images.material[shown] == material_index("helmet") + 1).all()
    assert len(MATERIALS) < 128  # limit of a pixel next to the number of its instance


def test_the_class_table_names_materials_once_and_only_available_ones():
    listed = [name for names in MATERIAL_CLASSES.values() for name in names]
    assert set(listed) <= set(MATERIALS) and len(listed) == len(set(listed))
    assert set(MATERIAL_CLASSES) <= set(CLASSES) and len(set(CLASSES.values())) == len(CLASSES)

from collections import defaultdict

import numpy as np
import pytest

from assets.models import CATALOGUE, build_model, model_spec


def by_size():
    groups = defaultdict(list)
    for spec in CATALOGUE.values():
        groups[(spec.body, spec.size_m)].append(spec)
    return groups


def test_variants_of_one_size_share_every_dimension():
    for specs in by_size().values():
        assert len(specs) >= 2
        assert {spec.variant for spec in specs} == set(range(len(specs)))
        axles = {(spec.wheelbase_m, spec.front_axle_x_m, spec.rear_axle_x_m, spec.track_m) for spec in specs}
        assert len(axles) == 1


def test_variants_of_one_size_differ_in_shape():
    for specs in by_size().values():
        meshes = [build_model(spec.name) for spec in specs]
        shapes = {mesh.vertices.tobytes() for mesh in meshes}
        assert len(shapes) == len(specs)


def test_axles_lie_within_the_body_and_a_wheelbase_apart():
    for spec in CATALOGUE.values():
        if spec.wheelbase_m:
            assert spec.front_axle_x_m - spec.rear_axle_x_m == pytest.approx(spec.wheelbase_m)
            assert -spec.length_m / 2 < spec.rear_axle_x_m < spec.front_axle_x_m < spec.length_m / 2


@pytest.mark.parametrize(
    ("kind", "mean_m", "tolerance_m"),
    [  # mean length, width, height of the KITTI training labels
        ("car", (3.88, 1.63, 1.53), (0.43, 0.10, 0.14)),
        ("van", (5.07, 1.90, 2.21), (0.10, 0.05, 0.10)),
        ("truck", (10.1, 2.59, 3.25), (0.30, 0.10, 0.10)),
        ("pedestrian", (0.84, 0.66, 1.76), (0.05, 0.05, 0.05)),
        ("person_sitting", (0.80, 0.59, 1.27), (0.05, 0.05, 0.08)),
        ("cyclist", (1.76, 0.60, 1.74), (0.01, 0.01, 0.01)),
    ],
)
def test_sizes_are_those_of_kitti(kind, mean_m, tolerance_m):
    sizes = np.array([spec.size_m for spec in CATALOGUE.values() if spec.kind == kind])
    assert (np.abs(sizes.mean(0) - mean_m) <= tolerance_m).all()


def test_an_unknown_model_is_refused_by_name():
    with pytest.raises(KeyError, match="coupe_01"):
        model_spec("coupe_01")

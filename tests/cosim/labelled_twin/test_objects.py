"""A model fills exactly the box that was labelled, however the LiDAR is mounted."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from assets import CATALOGUE
from cosim.drives.kitti import Calibration, Labels
from cosim.drives.twin.trust import in_box
from cosim.labelled_twin.objects import label_instances

_TILT = 0.02


def _calibration() -> Calibration:
    cos, sin = np.cos(_TILT), np.sin(_TILT)
    pitched = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    axes = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]], float)
    return Calibration(
        P2=np.array([[700, 0, 600, 0], [0, 700, 180, 0], [0, 0, 1, 0]], float),
        R0_rect=np.eye(3),
        Tr_velo_to_cam=np.column_stack([pitched @ axes, [0.01, -0.08, -0.27]]),
    )


def _labels(names: list[str], seed: int) -> Labels:
    rng, count = np.random.default_rng(seed), len(names)
    return Labels(
        type=tuple(names),
        truncated=np.zeros(count),
        occluded=np.zeros(count),
        alpha=np.zeros(count),
        bbox=np.zeros((count, 4)),
        dimensions=rng.uniform([1, 0.5, 0.6], [3, 2.5, 12], (count, 3)),
        location=rng.uniform([-15, 1, 3], [15, 2, 60], (count, 3)),
        rotation_y=rng.uniform(-np.pi, np.pi, count),
    )


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_corners_of_the_scaled_model_are_the_labels(seed: int) -> None:
    labels, calibration = _labels(["Car", "van", "TRUCK", "Pedestrian", "Cyclist"], seed)[:], _calibration()
    world_from_lidar = np.eye(4)
    world_from_lidar[:3, 3] = -0.5, 0, 1.73
    instances, without = label_instances(labels, calibration, world_from_lidar)
    assert without == 0
    assert [instance.kind for instance in instances] == ["car", "van", "truck", "pedestrian", "cyclist"]
    expected = calibration.rect_to_velo(labels.corners_rect.reshape(-1, 3)).reshape(-1, 8, 3) + world_from_lidar[:3, 3]
    for instance, corners in zip(instances, expected, strict=True):
        spec = CATALOGUE[instance.model]
        assert spec.kind == instance.kind
        half = np.array([spec.length_m / 2, spec.width_m / 2, spec.height_m])
        local = np.array([[x, y, z] for z in (0, 1) for x in (1, -1) for y in (1, -1)]) * half
        world = (local * instance.scale) @ instance.pose[:3, :3].T + instance.pose[:3, 3]
        gaps = np.linalg.norm(world[:, None] - corners[None], axis=2)
        assert gaps.min(1).max() < 1e-9
        assert gaps.min(0).max() < 1e-9
        inwards = corners.mean(0) + 0.999 * (corners - corners.mean(0))
        assert in_box(inwards, instance, 0.0).all()
        assert not in_box(corners.mean(0) + 1.2 * (corners - corners.mean(0)), instance, 0.0).any()
        front = instance.pose[:3, 0] @ world_from_lidar[:3, :3]
        assert np.linalg.det(instance.pose[:3, :3]) > 0.999
        assert np.isclose(np.linalg.norm(front), 1)


def test_objects_without_a_model_are_counted_and_left_out() -> None:
    labels = _labels(["Tram", "Misc", "Person_sitting", "Car"], 0)
    instances, without = label_instances(labels, _calibration(), np.eye(4))
    assert [instance.id for instance in instances] == ["tram0", "person_sitting2", "car3"]
    assert without == 1

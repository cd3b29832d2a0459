"""Parts of the detectors against plain reckoning."""

from __future__ import annotations

import math

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from torch.nn import functional  # noqa: E402

from training.data.grid import Grid  # noqa: E402
from training.data.voxels import voxelise  # noqa: E402
from training.evaluation.rotated_overlap import paired_iou  # noqa: E402
from training.loop import OneCycle  # noqa: E402
from training.models.anchors import anchor_classes, make_anchors  # noqa: E402
from training.models.assigning import assign  # noqa: E402
from training.models.coding import decode, direction_of, encode, with_direction  # noqa: E402
from training.models.nms import suppress  # noqa: E402
from training.models.regions import in_region, refine  # noqa: E402
from training.models.settings import ModelSettings  # noqa: E402
from training.models.sparse_conv import SparseTensor, StridedConv, SubmanifoldConv  # noqa: E402


def boxes(rng: np.random.Generator, count: int) -> torch.Tensor:
    coordinates = rng.uniform(-8, 8, (count, 3))
    size = rng.uniform(0.5, 5, (count, 3))
    return torch.tensor(np.column_stack([coordinates, size, rng.uniform(-3.1, 3.1, count)]), dtype=torch.float32)


def test_boxes_come_back_from_their_residuals():
    rng = np.random.default_rng(0)
    subset, anchors = boxes(rng, 50), boxes(rng, 50)
    assert torch.allclose(decode(encode(subset, anchors), anchors), subset, atol=1e-4)


def test_refining_by_the_exact_residual_gives_the_object_up_to_a_half_turn():
    rng = np.random.default_rng(1)
    objects = boxes(rng, 40)
    rois = objects + torch.tensor(rng.uniform(-0.2, 0.2, (40, 7)), dtype=torch.float32)
    local, anchor = in_region(objects, rois)
    found = refine(rois, encode(local, anchor))
    assert torch.allclose(found[:, :6], objects[:, :6], atol=1e-4)
    assert torch.allclose(torch.cos(2 * (found[:, 6] - objects[:, 6])), torch.ones(40), atol=1e-4)


@pytest.mark.parametrize("offset", [0.78539, -math.pi / 2])
def test_a_heading_up_to_half_a_turn_and_its_half_give_the_heading(offset):
    yaw = torch.linspace(-3.1, 3.1, 200)
    ambiguous = yaw + math.pi * (torch.arange(200) % 2)
    found = with_direction(ambiguous, direction_of(yaw, offset), offset)
    assert torch.allclose(torch.cos(found - yaw), torch.ones(200), atol=1e-4)


def test_suppression_keeps_the_surest_of_each_crowd_as_one_by_one_reckoning_does():
    rng = np.random.default_rng(2)
    subset, scores = boxes(rng, 150), torch.tensor(rng.uniform(0, 1, 150))
    for limit in (0.01, 0.3, 0.7):
        table = subset.numpy().astype(np.float64)[:, [0, 1, 3, 4, 6]]
        expected: list[int] = []
        for row in np.argsort(-scores.numpy()):
            if all(paired_iou(table[row : row + 1], table[kept : kept + 1])[0] <= limit for kept in expected):
                expected.append(int(row))
        assert suppress(subset, scores, limit, before=150, after=150).tolist() == expected


def test_sparse_convolutions_equal_dense_ones_where_they_answer():
    generator = torch.Generator().manual_seed(0)
    dense = torch.randn(2, 3, 5, 6, 7, generator=generator)
    dense *= torch.rand(2, 1, 5, 6, 7, generator=generator) < 0.2
    coordinates = torch.nonzero(dense.abs().sum(1))
    features = dense[coordinates[:, 0], :, coordinates[:, 1], coordinates[:, 2], coordinates[:, 3]]
    tensor = SparseTensor(features, coordinates, (5, 6, 7), 2)
    assert torch.equal(tensor.dense(), dense)
    same = SubmanifoldConv(3, 4, (3, 3, 3))
    expected = functional.conv3d(dense, same.weight.permute(0, 4, 1, 2, 3), padding=1)
    occupied = (dense.abs().sum(1, keepdim=True) > 0).expand_as(expected)
    assert torch.allclose(same(tensor).dense()[occupied], expected[occupied], atol=1e-5)
    coarse = StridedConv(3, 4, (3, 3, 3), (2, 2, 2), (0, 1, 1))
    expected = functional.conv3d(dense, coarse.weight.permute(0, 4, 1, 2, 3), stride=2, padding=(0, 1, 1))
    assert torch.allclose(coarse(tensor).dense(), expected, atol=1e-5)


def test_every_point_in_the_range_is_in_the_cell_it_lies_in():
    rng = np.random.default_rng(3)
    points = torch.tensor(rng.uniform(-1, 5, (500, 5)), dtype=torch.float32)
    points[:, 0] = torch.tensor(rng.integers(0, 2, 500))
    grid = Grid((0.0, 0.0, 0.0), (4.0, 3.0, 2.0), (0.5, 1.0, 2.0))
    voxels = voxelise(points, grid)
    inside = ((points[:, 1:4] >= 0) & (points[:, 1:4] < torch.tensor([4.0, 3.0, 2.0]))).all(1)
    assert len(voxels.points) == inside.sum()
    own = voxels.coordinates[voxels.cell]
    assert torch.equal(own[:, 0], voxels.points[:, 0].long())
    assert torch.equal(own[:, 3], (voxels.points[:, 1] // 0.5).long())
    assert torch.equal(own[:, 2], voxels.points[:, 2].long())
    limited = voxelise(points, grid, max_points=3, max_cells=10)
    assert limited.count.max() <= 3 and torch.bincount(limited.coordinates[:, 0]).max() <= 10


def test_an_anchor_on_an_object_is_to_find_it_and_one_on_an_ignored_object_is_neither():
    classes = anchor_classes(["Car"])
    anchors = make_anchors(classes, Grid((0, -8, -3), (16, 8, 1), (0.4, 0.4, 4)), 2)
    places = anchors.reshape(-1, 7)
    car, van = places[100].clone(), places[260].clone()
    targets = assign(anchors, classes, [torch.stack([car, van])], [torch.tensor([0, -1])])
    assert targets.label[0, 100] == 1 and torch.allclose(targets.residual[0, 100], torch.zeros(7), atol=1e-6)
    assert targets.label[0, 260] == -1
    assert (targets.label == 0).float().mean() > 0.9
    small = car.clone()
    small[3:5] *= 0.5
    assert (assign(anchors, classes, [small[None]], [torch.tensor([0])]).label == 1).any()


def test_the_cycle_rises_to_its_peak_and_ends_near_nothing():
    cycle = OneCycle(0.01, 100)
    rates = [cycle.at(step)[0] for step in range(100)]
    assert max(rates) == pytest.approx(0.01) and np.argmax(rates) == 40
    assert rates[0] == pytest.approx(0.001) and rates[-1] < 1e-4
    assert np.all(np.diff(rates[:40]) > 0) and np.all(np.diff(rates[41:]) < 0)


def test_a_grid_that_the_strides_do_not_divide_is_refused():
    with pytest.raises(ValueError, match="multiple of 8"):
        ModelSettings(high_m=(51.4, 25.6, 1.0))

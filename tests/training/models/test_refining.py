"""The second stage: what it sees of a region, what it learns from, and how it is put onto a first stage."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from tests.training.tiny_drive import GROUND_M, car_points  # noqa: E402
from training.checkpoints import load_detector, load_weights, save_checkpoint  # noqa: E402
from training.data import IGNORED, TrainingSample  # noqa: E402
from training.data.batch import collate  # noqa: E402
from training.models.build import build_detector  # noqa: E402
from training.models.point_refiner import PointRefiner  # noqa: E402
from training.models.regions import overlap_3d, refine, regions_to_learn  # noqa: E402
from training.models.settings import ModelSettings  # noqa: E402

_TINY = {"layers": [1, 1, 1], "channels": [8, 8, 8], "upsample_channels": [8, 8, 8]}


@pytest.fixture(scope="module")
def refiner() -> PointRefiner:
    torch.manual_seed(0)
    net = PointRefiner(width=32, most_points=64, dropout=0.0).eval()
    torch.nn.init.normal_(net.residual.weight, std=0.1)
    return net


def seen(positions=((12.0, 3.0), (20.0, -6.0))) -> tuple[torch.Tensor, torch.Tensor]:
    """Points (n, 5) on cars, and boxes (m, 7) with a small offset."""
    rng = np.random.default_rng(0)
    boxes = np.array([[x, y, GROUND_M + 0.75, 3.9, 1.6, 1.5, 0.4 + y] for x, y in positions])
    points = np.concatenate([car_points(box, rng) for box in boxes])
    boxes += rng.normal(0, 0.1, boxes.shape)
    return tuple(torch.tensor(subset, dtype=torch.float32) for subset in (np.insert(points, 0, 0, axis=1), boxes))


def refined(net: PointRefiner, points: torch.Tensor, boxes: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    with torch.no_grad():
        scores, residuals = net(points, boxes, torch.zeros(len(boxes), dtype=torch.int64))
    return scores, refine(boxes, residuals)


def turned(table: torch.Tensor, x: int, angle: float) -> torch.Tensor:
    """Rows with their columns x and x + 1 turned about the sensor."""
    result, c, s = table.clone(), math.cos(angle), math.sin(angle)
    result[:, x], result[:, x + 1] = c * table[:, x] - s * table[:, x + 1], s * table[:, x] + c * table[:, x + 1]
    return result


def test_turning_the_scene_about_the_sensor_turns_the_refined_boxes(refiner):
    points, boxes = seen()
    scores, found = refined(refiner, points, boxes)
    assert (found - boxes).abs().max() > 0.01
    angle = 0.7
    moved = turned(boxes, 0, angle)
    moved[:, 6] += angle
    scores_too, found_too = refined(refiner, turned(points, 1, angle), moved)
    expected = turned(found, 0, angle)
    expected[:, 6] += angle
    assert torch.allclose(scores, scores_too, atol=1e-4) and torch.allclose(expected, found_too, atol=1e-4)


def test_shifting_the_scene_shifts_the_refined_boxes_as_long_as_the_same_faces_are_seen(refiner):
    points, boxes = seen()
    scores, found = refined(refiner, points, boxes)
    shift = torch.tensor([1.5, 0.5])
    points[:, 1:3] += shift
    boxes[:, :2] += shift
    scores_too, found_too = refined(refiner, points, boxes)
    found[:, :2] += shift
    assert torch.allclose(scores, scores_too, atol=1e-4) and torch.allclose(found, found_too, atol=1e-4)


def test_the_mirror_image_of_a_scene_has_the_mirror_images_of_its_boxes(refiner):
    points, boxes = seen()
    scores, found = refined(refiner, points, boxes)
    points[:, 2] *= -1
    boxes[:, [1, 6]] *= -1
    scores_too, found_too = refined(refiner, points, boxes)
    found[:, [1, 6]] *= -1
    assert torch.allclose(scores, scores_too, atol=1e-4) and torch.allclose(found, found_too, atol=1e-4)


def test_points_of_other_frames_and_of_the_ground_are_not_looked_at(refiner):
    points, boxes = seen()
    scores, _ = refined(refiner, points, boxes)
    elsewhere, ground = points.clone(), points.clone()
    elsewhere[:, 0], ground[:, 3] = 1, GROUND_M - 0.02
    assert torch.equal(scores, refined(refiner, torch.cat([points, elsewhere, ground]), boxes)[0])


def test_regions_without_points_and_frames_without_regions_are_no_trouble(refiner):
    points, boxes = seen()
    assert torch.isfinite(refined(refiner, points[:0], boxes)[1]).all()
    assert refined(refiner, points, boxes[:0])[1].shape == (0, 7)


def test_half_of_the_regions_are_on_objects_and_none_is_only_on_an_ignored_one():
    points, boxes = (subset.numpy() for subset in seen())
    class_ids = np.array([0, IGNORED])
    batch = collate(
        [
            TrainingSample("a", points[:, 1:], boxes, class_ids),
            TrainingSample("empty", points[:, 1:], boxes[:0], class_ids[:0]),
        ]
    )
    far = torch.tensor(boxes[:1]) + torch.arange(1, 30)[:, None] * torch.tensor([0.5, 0, 0, 0, 0, 0, 0])
    offered = torch.cat([torch.tensor(boxes), far])
    regions = regions_to_learn(batch, lambda frame: offered, 16, 20, torch.Generator().manual_seed(0))
    assert torch.bincount(regions.frame).tolist() == [16, 16]
    first = regions.frame == 0
    assert (regions.overlap[first] >= 0.55).sum() == 8
    car, ignored = (overlap_3d(regions.boxes[first], torch.tensor(boxes[row : row + 1]))[:, 0] for row in (0, 1))
    assert torch.allclose(car, regions.overlap[first], atol=1e-5) and (ignored <= 0.25).all()
    assert (regions.overlap[~first] == 0).all()


def test_a_second_stage_is_added_to_a_trained_first_stage(tmp_path):
    alone, both = (ModelSettings.model_validate({**_TINY, "refine": refine}) for refine in (False, True))
    first = build_detector(alone, ("Car",))
    save_checkpoint(tmp_path / "first.pt", first, alone, ("Car",))
    whole = build_detector(both, ("Car",))
    before = {name: value.clone() for name, value in whole.state_dict().items()}
    load_weights(whole, tmp_path / "first.pt", ("Car",))
    for name, value in whole.state_dict().items():
        kept = before[name] if name.startswith("refiner.") else first.state_dict()[name]
        assert torch.equal(value, kept), name
    save_checkpoint(tmp_path / "whole.pt", whole, both, ("Car",))
    again, _ = load_detector(tmp_path / "whole.pt")
    assert again.settings.refine and set(again.state_dict()) == set(before)


def test_intensities_have_no_influence_on_a_detector_without_them():
    points, boxes = seen()
    sample = TrainingSample("cars", points[:, 1:].numpy(), boxes.numpy(), np.zeros(len(boxes), np.int64))
    bright = replace(sample, points=sample.points * np.float32([1, 1, 1, 0]) + np.float32([0, 0, 0, 0.7]))
    found = {}
    for report in (False, True):
        torch.manual_seed(0)
        detector = build_detector(ModelSettings.model_validate({**_TINY, "intensity": report}), ("Car",)).eval()
        found[report] = [detector.detect(collate([subset]), 0.0)[0].scores for subset in (sample, bright)]
    assert len(found[False][0]) and np.array_equal(*found[False])
    assert len(found[True][0]) != len(found[True][1]) or not np.allclose(*found[True])
    assert not ModelSettings().intensity and ModelSettings(name="pointpillars").intensity


def test_an_old_checkpoint_without_the_key_uses_intensities(tmp_path):
    detector = build_detector(ModelSettings.model_validate(_TINY), ("Car",))
    save_checkpoint(tmp_path / "a.pt", detector, detector.settings, ("Car",))
    content = torch.load(tmp_path / "a.pt")
    del content["model"]["intensity"]
    torch.save(content, tmp_path / "b.pt")
    report = [load_detector(tmp_path / name)[0].settings.intensity for name in ("a.pt", "b.pt")]
    assert report == [False, True]

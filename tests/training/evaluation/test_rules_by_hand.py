"""Constructed cases whose right answer follows from KITTI's rules by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cosim.drives.kitti import Labels
from tests.training.evaluation.scenes import perfect
from training.errors import EvaluationError
from training.evaluation import evaluate, pair_frames
from training.evaluation.as_json import as_json
from training.evaluation.comparable import parse_classes, rename_classes

_MANY = 41  # objects from which on a perfect detector reaches 100


def cars(count: int = 1, kind: str = "Car", height_px: float = 100.0, x_m: float = 0.0) -> Labels:
    """Cars 30 m apart along the road, each 3.9 m long, all with the same image size side by side."""
    numbers = np.arange(count)
    left = 200.0 * numbers + 1000 * x_m
    return Labels(
        (kind,) * count,
        np.zeros(count),
        np.zeros(count),
        np.full(count, 0.3),
        np.column_stack([left, np.full(count, 100.0), left + 150, np.full(count, 100.0 + height_px)]),
        np.tile([1.5, 1.6, 3.9], (count, 1)),
        np.column_stack([np.full(count, x_m), np.full(count, 1.6), 10 + 30.0 * numbers]),
        np.zeros(count),
    )


def scored(labels: list[Labels], detections: list[Labels], name: str = "Car"):
    return evaluate(pair_frames(labels, detections)).results[name]


def sure(labels: Labels, score: float = 1.0) -> Labels:
    return replace(labels, score=np.full(len(labels), score))


def test_a_perfect_detector_scores_100_on_enough_objects():
    results = scored([cars()] * _MANY, [perfect(cars())] * _MANY)
    for levels in results.values():
        for result in levels:
            assert result.r40 == result.r11 == result.continuous == pytest.approx(100)
    assert results["2d"][1].aos40 == pytest.approx(100)


@pytest.mark.parametrize("count", [2, 10, 40])
def test_with_n_objects_a_perfect_detector_reaches_only_n_minus_1_of_40_slots(count):
    result = scored([cars()] * count, [perfect(cars())] * count)["3d"][1]
    assert result.r40 == pytest.approx(100 * (count - 1) / 40)
    assert result.continuous == pytest.approx(100)


def test_nothing_detected_is_null_and_detections_of_nothing_are_zero():
    nothing = as_json(evaluate(pair_frames([cars()] * 3, [Labels.empty()] * 3)))
    assert nothing == {"Car": None, "Pedestrian": None, "Cyclist": None}
    ghosts = as_json(evaluate(pair_frames([Labels.empty()] * 3, [sure(cars())] * 3)))
    assert ghosts["Car"]["3d"]["R40"] == [0, 0, 0] and ghosts["Car"]["aos"]["R11"] == [0, 0, 0]


def test_half_the_answers_false_and_surer_halve_the_precision():
    ghost = sure(cars(x_m=15.0), 2.0)
    result = scored([cars()] * _MANY, [sure(cars()).followed_by(ghost)] * _MANY)["3d"][1]
    assert result.r40 == pytest.approx(50)


def test_a_van_detected_as_a_car_is_neither_hit_nor_false():
    labels = [cars()] * _MANY + [cars(kind="Van")] * 30
    result = scored(labels, [sure(cars())] * _MANY + [sure(cars(), 2.0)] * 30)["3d"][1]
    assert result.r40 == pytest.approx(100)


def test_class_names_do_not_depend_on_case():
    result = scored([cars(kind="cAR")] * _MANY, [sure(cars(kind="CAR"))] * _MANY)["3d"][1]
    assert result.r40 == pytest.approx(100)


def test_dont_care_regions_absorb_false_positives_in_the_image_only():
    region = replace(cars(kind="DontCare"), bbox=np.array([[5000.0, 0, 7000, 400]]))
    ghost = replace(sure(cars(x_m=15.0), 2.0), bbox=np.array([[5500.0, 100, 5650, 200]]))
    labels = [cars().followed_by(region)] * _MANY
    results = scored(labels, [sure(cars()).followed_by(ghost)] * _MANY)
    assert results["2d"][1].r40 == pytest.approx(100)
    assert results["3d"][1].r40 == results["bev"][1].r40 == pytest.approx(50)


def test_a_detection_too_small_takes_an_object_whatever_its_class():
    """Ten cars have only a pedestrian's detection on them, 20 px high: neither found nor missed."""
    small = sure(cars(kind="Pedestrian", height_px=20.0))
    labels = [cars()] * (_MANY + 10)
    with_small = scored(labels, [sure(cars())] * _MANY + [small] * 10)["3d"][1]
    without = scored(labels, [sure(cars())] * _MANY + [Labels.empty()] * 10)["3d"][1]
    assert with_small.recall.max() == 1.0
    assert without.recall.max() == pytest.approx(_MANY / (_MANY + 10))


@pytest.mark.parametrize(("height_px", "counts"), [(25.0, 0), (25.5, 1)])
def test_objects_of_exactly_the_least_height_do_not_count_but_such_detections_do(height_px, counts):
    result = scored([cars(height_px=height_px)], [sure(cars(height_px=25.0))])["3d"][1]
    assert result.task.object_counts.sum() == counts
    assert result.task.valid.all()


def test_precision_is_taken_with_the_greatest_overlap_thresholds_with_the_highest_score():
    """Of two detections on each car the worse-placed is surer; at its score the better one does not exist yet."""
    near = sure(cars(), 0.4)
    off = replace(cars(), location=cars().location + np.array([0.1, 0, 0.2]))
    result = scored([cars()] * _MANY, [sure(off, 0.9).followed_by(near)] * _MANY)["bev"][1]
    assert set(result.thresholds) == {0.9}
    assert result.r40 == pytest.approx(100)


def test_an_overlap_of_exactly_the_limit_is_no_hit():
    """Boxes of 100 × 70 px inside boxes of 100 × 100 px overlap by 0.7."""
    found = replace(sure(cars()), bbox=np.array([[0.0, 100, 150, 170]]))
    assert scored([cars()] * _MANY, [found] * _MANY)["2d"][1].r40 == 0
    taller = replace(found, bbox=np.array([[0.0, 100, 150, 170.1]]))
    assert scored([cars()] * _MANY, [taller] * _MANY)["2d"][1].r40 == pytest.approx(100)


def test_orientation_counts_by_the_cosine_and_one_missing_alpha_voids_it():
    turned = replace(sure(cars()), alpha=cars().alpha + np.pi / 3)
    result = scored([cars()] * _MANY, [turned] * _MANY)["2d"][1]
    assert (result.r40, result.aos40) == (pytest.approx(100), pytest.approx(75))
    unknown = replace(sure(cars(kind="Pedestrian")), alpha=np.array([-10.0]))
    message = as_json(evaluate(pair_frames([cars()] * _MANY, [turned.followed_by(unknown)] * _MANY)))
    assert message["Car"]["aos"] is None and message["Car"]["2d"]["R40"][1] == pytest.approx(100)


@pytest.mark.parametrize("side", ["labels", "detections", "both"])
@pytest.mark.parametrize("value", [-1.0, 0.0])
def test_without_image_boxes_3d_is_scored_and_the_image_metrics_are_null(side, value):
    none = {"bbox": np.full((1, 4), value)}
    labels = cars() if side == "detections" else replace(cars(), **none)
    found = sure(cars()) if side == "labels" else replace(sure(cars()), **none)
    result = as_json(evaluate(pair_frames([labels] * _MANY, [found] * _MANY)))["Car"]
    assert result["2d"] is None and result["aos"] is None
    assert result["3d"]["R40"] == result["bev"]["R40"] == pytest.approx([100, 100, 100])
    assert "without the image rules" in result["rules"]


def test_without_image_boxes_far_objects_are_hard_and_objects_without_points_do_not_count():
    far = replace(cars(), bbox=np.zeros((1, 4)), location=np.array([[0.0, 1.6, 35.0]]))
    levels = scored([far] * _MANY, [sure(far)] * _MANY)["3d"]
    assert [int(level.task.object_counts.sum()) for level in levels] == [0, _MANY, _MANY]
    points = np.array([3] * 11 + [60] * (_MANY - 11))
    result = evaluate(pair_frames([far] * _MANY, [sure(far)] * _MANY), points=points).results["Car"]["3d"][2]
    assert result.task.object_counts.sum() == _MANY - 11


@pytest.mark.parametrize(
    ("labelled", "found", "option"),
    [
        ("Vehicle", "Car", "Vehicle=Car"),
        ("Car", "vehicle", "vehicle=Car"),
        ("4", "4", "4=Car"),
        ("Bike", "Cyclist", "Bike=Cyclist"),
    ],
)
def test_classes_of_other_names_are_refused_and_mapped(labelled, found, option):
    frames = pair_frames([cars(kind=labelled)] * _MANY, [sure(cars(kind=found))] * _MANY)
    with pytest.raises(EvaluationError, match=f"--classes {option}"):
        evaluate(frames)
    name = option.partition("=")[2]
    mapped = rename_classes(frames, parse_classes([option]))
    assert evaluate(mapped).results[name]["3d"][1].r40 == pytest.approx(100)


def test_a_mapping_of_classes_that_means_nothing_is_refused():
    frames = pair_frames([cars()], [sure(cars())])
    with pytest.raises(EvaluationError, match="NAME=CLASS"):
        parse_classes(["Vehicle=Lorry"])
    with pytest.raises(EvaluationError, match="the files contain car"):
        rename_classes(frames, parse_classes(["Vehicle=Car"]))


def test_hidden_and_cut_off_objects_count_from_their_difficulty_on():
    partly = replace(cars(), occluded=np.array([1]), truncated=np.array([0.4]))
    levels = scored([cars()] * _MANY + [partly] * 41, [sure(cars())] * _MANY + [Labels.empty()] * 41)["3d"]
    assert [int(result.task.object_counts.sum()) for result in levels] == [41, 41, 82]
    assert levels[2].recall.max() == pytest.approx(0.5)


@pytest.mark.parametrize("column", [[1.0, 1.0, 0.0], [1757.0, 12.0, 3.0]], ids=["flags", "track numbers"])
def test_a_truncation_that_the_image_boxes_contradict_is_not_used(column):
    labels = replace(cars(3), truncated=np.array(column))
    labels.bbox[:] = [[300, 100, 400, 200], [500, 100, 600, 200], [0, 0, 1242, 375]]
    evaluation = evaluate(pair_frames([labels] * _MANY, [perfect(labels)] * _MANY))
    assert evaluation.results["Car"]["3d"][0].task.object_counts.sum() == 3 * _MANY
    assert (
        "no truncation" in evaluation.notes["Car"] and "truncation is not used" in as_json(evaluation)["Car"]["rules"]
    )


@pytest.mark.parametrize("edges", [(0.0, 80.0), (560.0, 600.0)], ids=["left edge", "right edge"])
def test_whole_truncations_of_objects_at_an_edge_of_the_image_count(edges):
    labels = cars(3)
    labels.bbox[0, [0, 2]] = edges
    labels = replace(labels, truncated=np.array([1.0, 0.0, 0.0]))
    evaluation = evaluate(pair_frames([labels] * _MANY, [perfect(labels)] * _MANY))
    assert evaluation.results["Car"]["3d"][2].task.object_counts.sum() == 2 * _MANY
    assert not evaluation.notes


def test_without_objects_there_is_no_average_precision():
    result = scored([Labels.empty()] * 3, [sure(cars())] * 3)["3d"][1]
    assert [result.text(kind) for kind in ("r40", "r11", "continuous")] == ["–"] * 3
    assert scored([cars()] * _MANY, [perfect(cars())] * _MANY)["3d"][1].text("r40") == "100.00"

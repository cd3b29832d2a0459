"""`cosim losses`: what each kind of error takes, of detections whose errors are known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from cosim.cli import main
from cosim.drives.kitti import Labels, write_labels
from tests.training.evaluation.scenes import as_detections, objects, perfect
from training.evaluation import pair_frames
from training.evaluation.losses.box_errors import box_errors
from training.evaluation.losses.faults import BOX_PARTS, OTHER_KINDS, find_faults
from training.evaluation.losses.split import LossSplit, draw_frames, parts_of_loss, split_loss

FRAMES, ROWS = 20, 4


def scene() -> list[Labels]:
    """Cars in a row, far enough from each other, all of them easy."""
    position = np.column_stack([np.zeros(ROWS), np.full(ROWS, 1.7), np.linspace(8, 26, ROWS)])
    cars = Labels(
        ("Car",) * ROWS,
        np.zeros(ROWS),
        np.zeros(ROWS),
        np.zeros(ROWS),
        np.tile([500.0, 150.0, 600.0, 250.0], (ROWS, 1)),
        np.tile([1.5, 1.6, 3.9], (ROWS, 1)),
        position,
        np.full(ROWS, 1.57),
    )
    return [cars] * FRAMES


def moved(detections: Labels, rows: slice, **by: object) -> Labels:
    """Detections of which some have other values."""
    columns = {name: getattr(detections, name).copy() for name in by}
    for name, value in by.items():
        columns[name][rows] += value
    return replace(detections, **columns)


def split(labels: list[Labels], detections: list[Labels], metric="3d") -> LossSplit:
    return split_loss(find_faults(pair_frames(labels, detections), "Car", metric))


def sole_loss(detections: Labels, metric="3d") -> tuple[str, LossSplit]:
    """The one kind that takes anything."""
    lost = split(scene(), [detections] * FRAMES, metric)
    (kind,) = [kind for kind, share in lost.share.items() if abs(share) > 1e-9]
    return kind, lost


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ({"location": [0, 0.5, 0]}, "height"),
        ({"location": [0, 0, 1.2]}, "position"),
        ({"rotation_y": 0.6}, "heading"),
        ({"dimensions": [0, 0, 2.5]}, "size"),
    ],
)
def test_a_fault_of_one_part_of_the_box_takes_all_that_is_lost(change, kind):
    found, lost = sole_loss(moved(perfect(scene()[0]), slice(0, 1), **change))
    assert found == kind and lost.share[kind] == pytest.approx(100 - lost.ap) == pytest.approx(lost.alone[kind])
    assert lost.ap < 80 and lost.faults.misfits.sum() == FRAMES


def test_seen_from_above_heights_take_nothing():
    lost = split(scene(), [moved(perfect(scene()[0]), slice(0, 4), location=[0, 0.5, 0])] * FRAMES, "bev")
    assert lost.ap == pytest.approx(100) and "height" not in lost.share


def test_a_loss_that_needs_two_corrections_is_shared_evenly():
    """A box a metre too tall on the same ground: its middle is too high, too."""
    lost = split(scene(), [moved(perfect(scene()[0]), slice(0, 4), dimensions=[1.0, 0, 0])] * FRAMES)
    assert lost.ap == pytest.approx(0) and lost.share["size"] == lost.share["height"] == pytest.approx(50)
    assert lost.alone["size"] == lost.alone["height"] == pytest.approx(0)


def test_what_was_not_detected_is_missed():
    kind, lost = sole_loss(perfect(scene()[0])[:3])
    assert kind == "misses" and lost.ap == pytest.approx(75) and lost.share["misses"] == pytest.approx(25)


def surer(detections: Labels, score: float = 2.0) -> Labels:
    return replace(detections, score=np.full(len(detections), score))


def test_a_confident_box_where_nothing_is_labelled_is_a_false_alarm():
    astray = surer(moved(perfect(scene()[0])[:1], slice(0, 1), location=[15, 0, 0]))
    kind, lost = sole_loss(perfect(scene()[0]).followed_by(astray))
    assert kind == "false_alarms" and lost.faults.false_alarms.sum() == FRAMES
    assert lost.ap == pytest.approx(80)  # at every recall one box of five is wrong


def test_a_box_round_a_truck_is_of_another_class():
    labels = [replace(cars, type=("Truck", "Car", "Car", "Car")) for cars in scene()]
    found = perfect(scene()[0])
    lost = split(labels, [replace(found, score=np.array([2.0, 1, 1, 1]))] * FRAMES)
    assert lost.share["other_class"] == pytest.approx(100 - lost.ap) == pytest.approx(25)


def test_a_second_surer_box_of_a_car_is_a_duplicate():
    second = surer(moved(perfect(scene()[0])[:1], slice(0, 1), location=[0, 0, 1.5]))
    kind, lost = sole_loss(perfect(scene()[0]).followed_by(second))
    assert kind == "duplicates" and lost.ap == pytest.approx(80)


def test_shares_add_up_and_corrections_never_reduce_ap():
    rng = np.random.default_rng(4)
    labels = [objects(rng, 9) for _ in range(12)]
    found = [as_detections(rng, subset, 0.25, ties=False) for subset in labels]
    for metric in ("3d", "bev"):
        lost = split(labels, found, metric)
        assert set(lost.share) == {*BOX_PARTS[metric], *OTHER_KINDS}
        assert lost.ap + sum(lost.share.values()) == pytest.approx(100)
        assert min(*lost.share.values(), *lost.alone.values()) > -1e-9


def test_boxes_are_measured_along_and_across_the_line_of_sight():
    found = moved(perfect(scene()[0]), slice(0, 4), location=[-0.1, -0.3, 0.2], dimensions=[0, 0.05, -0.4])
    faults = find_faults(pair_frames(scene(), [found] * FRAMES), "Car", "3d")
    whole = box_errors(faults)[0]
    report = [whole.median[part] for part in ("away_m", "aside_m", "height_m", "length_m", "width_m")]
    assert report == pytest.approx([0.2, 0.1, 0.3, -0.4, 0.05]) and whole.objects == FRAMES * ROWS
    assert max(whole.spread.values()) == pytest.approx(0, abs=1e-9)


def test_errors_are_detected_where_they_are():
    far = moved(perfect(scene()[0]), slice(3, 4), location=[0, 0.6, 0])
    faults = find_faults(pair_frames(scene(), [far] * FRAMES), "Car", "3d")
    by = {part.name: part.gain["height"] for part in parts_of_loss(faults, None, None)["distance"]}
    assert by["20–30 m"] == pytest.approx(100 - 75 * 0.75) and by["0–10 m"] == by["10–20 m"] == pytest.approx(0)


def test_draws_of_frames_that_are_equal_give_no_interval():
    found = [moved(perfect(scene()[0]), slice(0, 1), location=[0, 0.5, 0])] * FRAMES
    faults = find_faults(pair_frames(scene(), found), "Car", "3d")
    lost = split_loss(faults, draw_frames(FRAMES, 5, np.random.default_rng(0)))
    assert lost.drawn.shape == (5, 1 + len(lost.share))
    assert lost.drawn == pytest.approx(np.tile([lost.ap, *lost.share.values()], (5, 1)))


@pytest.fixture
def folders(tmp_path):
    """Labels, and detections of two detectors: one that sees all but sets boxes too high, and one that sees half."""
    high, half = moved(perfect(scene()[0]), slice(0, 4), location=[0, -0.4, 0]), perfect(scene()[0])[:2]
    for name, what in (("labels", scene()[0]), ("high", high), ("half", half)):
        (tmp_path / name).mkdir()
        for number in range(FRAMES):
            write_labels(tmp_path / name / f"{number:06d}.txt", what, 3)
    return tmp_path


def run(folder, *more: object) -> int:
    given = ["--detections", folder / "high", "--labels", folder / "labels", "--bootstrap", 5]
    return main([str(word) for word in ("losses", *given, *more)])


def test_two_detectors_are_compared(folders, capsys):
    assert run(folders, "--against", folders / "half", "--out", folders / "page", "--json", folders / "it.json") == 0
    message = json.loads((folders / "it.json").read_text())
    high, half = message["sets"]
    assert high["3d"]["kinds"]["height"]["share"] == pytest.approx(100 - high["3d"]["ap"])
    assert half["3d"]["kinds"]["misses"]["share"] == pytest.approx(50)
    assert message["difference"]["3d"]["misses"]["difference"] == pytest.approx(-50)
    assert "lost to height" in capsys.readouterr().out
    assert "first − second" in (folders / "page" / "index.html").read_text()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--bootstrap", "-1"], "--bootstrap is -1"),
        (["--against-labels", "x"], "--against"),
        (["--class", "Cyclist"], "no box of Cyclist"),
    ],
)
def test_errors_are_one_line(folders, capsys, more, words):
    assert run(folders, "--quiet", *more) == 2
    error = capsys.readouterr().err
    assert words in error and error.count("\n") == 1

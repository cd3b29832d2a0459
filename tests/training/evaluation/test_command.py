"""`cosim evaluate`: what it writes, and one line for a user's mistakes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cosim.cli import main
from cosim.drives.kitti import write_labels
from tests.training.evaluation.scenes import as_detections, objects, perfect
from training.evaluation import evaluate, pair_frames
from training.evaluation.bootstrap import interval, resample
from training.evaluation.slices import slices


@pytest.fixture
def folders(tmp_path: Path) -> Path:
    rng = np.random.default_rng(5)
    for name in ("labels", "detections"):
        (tmp_path / name).mkdir()
    for number in range(12):
        labels = objects(rng, 6, ("Car", "Pedestrian"))
        write_labels(tmp_path / "labels" / f"{number:06d}.txt", labels, 6)
        write_labels(tmp_path / "detections" / f"{number:06d}.txt", perfect(labels), 6)
    return tmp_path


def run(folder: Path, *more: object) -> int:
    given = ["--detections", folder / "detections", "--labels", folder / "labels", "--quiet"]
    return main([str(word) for word in ("evaluate", *given, *more)])


def test_json_holds_percent_by_difficulty_and_null_for_classes_without_detections(folders):
    assert run(folders, "--json", folders / "result.json", "--out", folders / "page") == 0
    message = json.loads((folders / "result.json").read_text())
    assert list(message) == ["Car", "Pedestrian", "Cyclist"] and message["Cyclist"] is None
    for metric in ("3d", "bev", "2d", "aos"):
        assert {len(message["Car"][metric][key]) for key in ("R40", "R11")} == {3}
    assert message["Car"]["3d"]["continuous"] == pytest.approx([100, 100, 100])
    page = (folders / "page" / "index.html").read_text()
    assert "Car, IoU over 0.7" in page and "<svg" in page


def test_frames_without_detections_count_as_empty_only_if_listed(folders, capsys):
    (folders / "detections" / "000003.txt").unlink()
    assert run(folders) == 2
    assert "000003" in capsys.readouterr().err
    (folders / "list.txt").write_text("000003\n000004\n")
    assert run(folders, "--frames", folders / "list.txt", "--out", folders / "page") == 0


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("Car 0 0 0 1 1 60 60 1.5 1.6 3.9 1 1.6 20 0", "score"),
        ("Car 0 0 0 1 1 60 60 1.5 1.6 3.9 1 1.6 20 0 nan", "finite"),
        ("Car 0 0 0 1 1 60 60 1.5 1.6 3.9 1 1.6", "columns"),
        ("Car 0 0 zero 1 1 60 60 1.5 1.6 3.9 1 1.6 20 0 0.5", "not a number"),
    ],
)
def test_broken_detections_are_named_in_one_line(folders, capsys, line, words):
    (folders / "detections" / "000002.txt").write_text(line + "\n")
    assert run(folders) == 2
    error = capsys.readouterr().err
    assert words in error and "000002.txt" in error and error.count("\n") == 1


def test_detections_of_unlabelled_frames_are_refused(folders, capsys):
    (folders / "labels" / "000007.txt").unlink()
    assert run(folders) == 2
    assert "000007" in capsys.readouterr().err


def test_an_interval_holds_the_figure_and_closes_where_all_frames_are_equal():
    rng = np.random.default_rng(2)
    labels = [objects(rng, 8, ("Car",)) for _ in range(40)]
    result = evaluate(pair_frames(labels, [as_detections(rng, subset, 0.03) for subset in labels])).results["Car"][
        "3d"
    ][2]
    low, high = interval(resample(result, np.random.default_rng(0), 300)[:, 0])
    assert low < result.r40 < high
    similar = evaluate(pair_frames([labels[0]] * 20, [perfect(labels[0])] * 20)).results["Car"]["bev"][2]
    assert np.ptp(resample(similar, np.random.default_rng(0), 50)[:, 1]) == pytest.approx(0)


def test_parts_of_the_objects_add_up_to_the_whole():
    rng = np.random.default_rng(3)
    labels = [objects(rng, 8, ("Car",)) for _ in range(30)]
    result = evaluate(pair_frames(labels, [perfect(subset) for subset in labels])).results["Car"]["3d"][2]
    for parts in slices(result, np.full(len(result.task.object_counts), 7)).values():
        assert sum(part.objects for part in parts) == result.task.object_counts.sum()
        assert all(part.ap == pytest.approx(100) for part in parts)

"""Pictures of detections: what fits is orange, what does not is red, what is not looked for is gray."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.drives.kitti import Drive, Labels
from training.evaluation import pair_frames
from training.evaluation.pictures import detection_pictures, draw

_ORANGE, _RED, _GREEN = (255, 178, 62), (240, 84, 84), (96, 220, 130)


def area(image: np.ndarray, colour: tuple[int, int, int]) -> int:
    """Pixels of about a colour."""
    return int((np.abs(image.astype(int) - colour).max(-1) < 40).sum())


def drawn(folder: Path, change) -> np.ndarray:
    """The first frame, with its own labels, changed, as detections."""
    drive = Drive(folder)
    names = drive.frames[:1]
    labels = [drive[name].labels for name in names]
    scored = [replace(subset, score=np.full(len(subset), 0.9)) for subset in labels]
    return draw(pair_frames(labels, [change(subset) for subset in scored], names), drive, 0)


def test_what_fits_is_orange_and_what_does_not_is_red(tiny_drive):
    right = drawn(tiny_drive, lambda labels: labels)
    aside = drawn(tiny_drive, lambda labels: replace(labels, location=labels.location - [5.0, 0, 0]))
    high = drawn(tiny_drive, lambda labels: replace(labels, location=labels.location - [0, 1.0, 0]))
    assert area(right, _ORANGE) > 200 and area(right, _RED) == 0
    assert area(aside, _ORANGE) == 0 and area(aside, _RED) > 200
    assert area(high, _RED) > 200  # fits from above, not in 3D


def test_detections_with_low_scores_are_left_out(tiny_drive):
    unsure = drawn(tiny_drive, lambda labels: replace(labels, score=labels.score * 0.1))
    assert area(unsure, _ORANGE) == area(unsure, _RED) == 0 and area(unsure, _GREEN) > 200


@pytest.mark.parametrize(("most", "pictures"), [(1, 1), (3, 3), (9, 4)])
def test_pictures_are_of_different_frames(tiny_drive, most, pictures):
    drive = Drive(tiny_drive)
    labels = [drive[name].labels for name in drive.frames]
    captions = [caption for caption, _ in detection_pictures(pair_frames(labels, [Labels.empty()] * 4), drive, most)]
    assert len(captions) == len(set(captions)) == pictures

"""Folders of KITTI text files as one table of labels and one of detections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.drives.kitti import Labels, read_labels
from cosim.drives.kitti.layout import read_split
from training.errors import EvaluationError


@dataclass(frozen=True, eq=False)
class ScoreTable:
    """Objects of all frames, frame after frame, in the order of their files.

    Attributes:
        objects: the rows; scores where they are detections.
        kind: (n,) class names in lower case.
        frame: (n,) int64 index of the frame of each row.
    """

    objects: Labels
    kind: np.ndarray
    frame: np.ndarray

    @classmethod
    def of(cls, frames: Sequence[Labels]) -> ScoreTable:
        """Join frames; scores are kept if all that hold objects have them."""
        filled = [labels for labels in frames if len(labels)]
        joined = _join(filled) if filled else Labels.empty()
        counts = [len(labels) for labels in frames]
        kind = np.array([name.lower() for name in joined.type], dtype=str)
        return cls(joined, kind, np.repeat(np.arange(len(frames)), counts))


@dataclass(frozen=True, eq=False)
class Scored:
    """Labels and detections of the same frames."""

    names: tuple[str, ...]
    labels: ScoreTable
    detections: ScoreTable


def pair_frames(labels: Sequence[Labels], detections: Sequence[Labels], names: Sequence[str] | None = None) -> Scored:
    """Labels and detections already read, frame by frame.

    Raises:
        EvaluationError: another number of frames on one side, or detections without scores.
    """
    if len(labels) != len(detections):
        raise EvaluationError(f"{len(labels)} frames of labels, {len(detections)} of detections; give both of all")
    names = tuple(names) if names is not None else tuple(f"{number:06d}" for number in range(len(labels)))
    for name, detected in zip(names, detections, strict=True):
        if len(detected) and detected.score is None:
            raise EvaluationError(f"detections of {name}: 15 columns, no score; end every line with one")
    return Scored(names, ScoreTable.of(labels), ScoreTable.of(detections))


def read_results(detections: Path, labels: Path, frames: Path | None = None) -> Scored:
    """Read what is to be scored.

    Args:
        detections: folder of NAME.txt, 16 columns.
        labels: folder of NAME.txt, 15 columns.
        frames: a list of names, one a line; of these a frame without a detection file has none. By default the
            frames of the labels, each of which then needs a detection file.

    Raises:
        EvaluationError: a folder or frame is missing on one side, or a detection has no score.
        FormatError: a line has wrong columns, or a value that is not a finite number.
    """
    detected, labelled_names = _names(_folder(detections, "detections")), _names(_folder(labels, "labels"))
    if frames is None:
        names = sorted(labelled_names)
        _require_none(labels, sorted(detected - labelled_names), "detections", "labels", "remove those detections")
        _require_none(
            detections,
            sorted(labelled_names - detected),
            "labels",
            "detections",
            "frames meant to be empty need --frames",
        )
    else:
        names = list(dict.fromkeys(read_split(frames)))
        _require_none(
            labels, [name for name in names if name not in labelled_names], "names", "labels", "shorten the list"
        )
    if not names:
        raise EvaluationError(f"{frames or labels}: names no frame; there is nothing to score")
    read_detections = [
        _read_detections(detections / f"{name}.txt") if name in detected else Labels.empty() for name in names
    ]
    return pair_frames([read_labels(labels / f"{name}.txt") for name in names], read_detections, names)


def _read_detections(path: Path) -> Labels:
    labels = read_labels(path)
    if len(labels) and labels.score is None:
        raise EvaluationError(f"{path}: 15 columns, no score; a detection has 16, the last its score")
    return labels


def _folder(path: Path, what: str) -> Path:
    if not path.is_dir():
        raise EvaluationError(f"{path}: no such folder; give that of the {what}, NAME.txt a frame")
    if not any(path.glob("*.txt")) and what == "labels":
        raise EvaluationError(f"{path}: holds no NAME.txt; give the folder of the label files itself")
    return path


def _names(folder: Path) -> set[str]:
    return {file.stem for file in folder.glob("*.txt")}


def _require_none(folder: Path, absent: list[str], present: str, missing: str, remedy: str) -> None:
    if absent:
        shown = ", ".join(absent[:3]) + (" …" if len(absent) > 3 else "")
        count = "1 frame has" if len(absent) == 1 else f"{len(absent)} frames have"
        raise EvaluationError(f"{folder}: {count} {present} but no {missing} ({shown}); {remedy}")


def _join(frames: Sequence[Labels]) -> Labels:
    scored = all(labels.score is not None for labels in frames)
    columns = ("truncated", "occluded", "alpha", "bbox", "dimensions", "location", "rotation_y")
    return Labels(
        tuple(name for labels in frames for name in labels.type),
        **{name: np.concatenate([getattr(labels, name) for labels in frames]) for name in columns},
        score=np.concatenate([np.asarray(labels.score) for labels in frames]) if scored else None,
    )

"""Object labels and detections in KITTI's format: `label_2/NAME.txt`, one object a line.

`type truncated occluded alpha x1 y1 x2 y2 h w l x y z rotation_y [score]`: location is the bottom centre in
rectified camera axes, rotation_y the heading about the camera's y axis (0 along +x, positive clockwise seen
from above), alpha = rotation_y − atan2(x, z). KITTI object development kit, readme.txt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from cosim.drives.files import numbers, read_text
from cosim.drives.kitti.boxes import Boxes, wrap_angle
from cosim.drives.kitti.calibration import Calibration
from cosim.errors import FormatError

DONT_CARE = "DontCare"
NOT_GIVEN = -1.0
"""Truncation of objects of which none is given."""
_COLUMNS = 15
_WIDTHS = {"bbox": 4, "dimensions": 3, "location": 3}
_CUT_OFF = 0.3  # objects that are cut off by so much end at an edge of the image
_EDGE_SHARE = 0.02  # of the image's width and height: all such objects of KITTI's training set end so near to an edge


@dataclass(frozen=True, eq=False)
class Labels:
    """The objects of one frame, a row each.

    Attributes:
        type: class names, `DontCare` for regions with unlabelled objects.
        truncated: (n,) float64, share of the object outside the image, 0–1; −1 if not given.
        occluded: (n,) int64, 0 visible, 1 partly, 2 largely occluded, 3 unknown; −1 if not given.
        alpha: (n,) float64 observation angle [rad].
        bbox: (n, 4) float64 left, top, right, bottom in the image of camera 2 [px].
        dimensions: (n, 3) float64 height, width, length [m].
        location: (n, 3) float64 bottom centre in rectified camera axes [m].
        rotation_y: (n,) float64 heading about the camera's y axis [rad].
        score: (n,) float64 confidence of a detection; None for labels.
    """

    type: tuple[str, ...]
    truncated: np.ndarray
    occluded: np.ndarray
    alpha: np.ndarray
    bbox: np.ndarray
    dimensions: np.ndarray
    location: np.ndarray
    rotation_y: np.ndarray
    score: np.ndarray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "type", tuple(self.type))
        for name in [field.name for field in fields(self)][1:]:
            value = getattr(self, name)
            if value is None:
                continue
            shape = (len(self.type), _WIDTHS[name]) if name in _WIDTHS else (len(self.type),)
            array = np.asarray(value, np.int64 if name == "occluded" else np.float64)
            if not array.size and not len(self.type):
                array = array.reshape(shape)
            if array.shape != shape:
                raise FormatError(f"labels: {name} has shape {array.shape}; expected {shape}")
            object.__setattr__(self, name, array)

    @classmethod
    def empty(cls) -> Labels:
        """No objects."""
        return cls((), *(np.zeros(0) for _ in range(7)))

    @classmethod
    def from_boxes(
        cls,
        boxes: Boxes,
        types: Sequence[str],
        calibration: Calibration,
        *,
        bbox: np.ndarray | None = None,
        truncated: np.ndarray | float = 0.0,
        occluded: np.ndarray | int = 0,
        score: np.ndarray | None = None,
    ) -> Labels:
        """Labels of boxes in LiDAR axes; the inverse of `boxes_velo`.

        Args:
            boxes: n boxes in LiDAR axes.
            types: n class names.
            calibration: carries them into camera axes, heading included.
            bbox: (n, 4) 2D boxes [px]; zeros if not given.
            truncated: one value, or one a box.
            occluded: one value, or one a box.
            score: (n,) confidences, for detections.
        """
        location = calibration.velo_to_rect(boxes.centre)
        location[:, 1] += boxes.size[:, 2] / 2
        heading = np.stack([np.cos(boxes.yaw), np.sin(boxes.yaw), np.zeros(len(boxes))], -1)
        turned = heading @ calibration.velo_to_rect_matrix[:3, :3].T
        rotation_y = np.arctan2(-turned[:, 2], turned[:, 0])
        return cls(
            type=tuple(types),
            truncated=np.broadcast_to(truncated, len(boxes)),
            occluded=np.broadcast_to(occluded, len(boxes)),
            alpha=wrap_angle(rotation_y - np.arctan2(location[:, 0], location[:, 2])),
            bbox=np.zeros((len(boxes), 4)) if bbox is None else bbox,
            dimensions=boxes.size[:, ::-1],
            location=location,
            rotation_y=rotation_y,
            score=score,
        )

    def boxes_velo(self, calibration: Calibration) -> Boxes:
        """The boxes in LiDAR axes: centre, (length, width, height) and yaw.

        The heading is carried by the calibration's rotation; with LiDAR and camera squarely mounted it is
        yaw = −rotation_y − π/2. Boxes of `DontCare` rows mean nothing: leave them out first.
        """
        centre = self.location - [0, 0.5, 0] * self.dimensions[:, :1]
        heading = np.stack([np.cos(self.rotation_y), np.zeros(len(self)), -np.sin(self.rotation_y)], -1)
        turned = heading @ calibration.rect_to_velo_matrix[:3, :3].T
        yaw = np.arctan2(turned[:, 1], turned[:, 0])
        return Boxes(calibration.rect_to_velo(centre), self.dimensions[:, ::-1], yaw)

    @property
    def truncation(self) -> np.ndarray:
        """Share (n,) of each object outside the image; 0 for all where `truncation_doubt` finds another meaning."""
        return np.zeros(len(self)) if truncation_doubt(self.truncated, self.bbox) else self.truncated

    @property
    def corners_rect(self) -> np.ndarray:
        """Corners in rectified camera axes, (n, 8, 3): the bottom four round the box, then the top four."""
        height, width, length = (self.dimensions[:, column, None] / 2 for column in range(3))
        along = length * np.array([1, 1, -1, -1, 1, 1, -1, -1])
        across = width * np.array([1, -1, -1, 1, 1, -1, -1, 1])
        up = height * np.array([0, 0, 0, 0, 2, 2, 2, 2])
        cos, sin = np.cos(self.rotation_y)[:, None], np.sin(self.rotation_y)[:, None]
        local = np.stack([cos * along + sin * across, -up, cos * across - sin * along], -1)
        return local + self.location[:, None]

    def __len__(self) -> int:
        return len(self.type)

    def __getitem__(self, rows: np.ndarray | slice) -> Labels:
        """Some of the objects, by mask, index array or slice."""
        index = np.arange(len(self))[rows]
        columns = {field.name: getattr(self, field.name) for field in fields(self)[1:]}
        chosen = {name: None if column is None else column[index] for name, column in columns.items()}
        return replace(self, type=tuple(self.type[i] for i in index), **chosen)

    def followed_by(self, others: Labels) -> Labels:
        """These objects and then others; scores stay only where both have them."""
        columns = {}
        for name in (field.name for field in fields(self)[1:]):
            own, theirs = getattr(self, name), getattr(others, name)
            columns[name] = None if own is None or theirs is None else np.concatenate([own, theirs])
        return Labels(type=(*self.type, *others.type), **columns)

    def of_type(self, *types: str) -> Labels:
        """The objects of the named classes, case-insensitive as in KITTI's evaluation."""
        wanted = {name.lower() for name in types}
        return self[np.array([name.lower() in wanted for name in self.type], bool)]

    @property
    def cared_for(self) -> Labels:
        """The objects without the `DontCare` regions."""
        return self[np.array([name.lower() != DONT_CARE.lower() for name in self.type], bool)]


def truncation_doubt(truncated: np.ndarray, bbox: np.ndarray) -> str:
    """Why a set's truncations are no shares outside the image; empty if two clues do not say so.

    Some data sets store a flag or a track number in this column (View-of-Delft: docs/ANNOTATION.md). Such columns hold
    whole numbers only, and the objects do not end at an edge of the image, as truncated ones do. The image is taken to
    reach from 0 to the largest coordinate of any 2D box.

    Args:
        truncated: (n,) the column.
        bbox: (n, 4) 2D boxes [px].
    """
    cut = truncated > _CUT_OFF
    if not cut.any() or (truncated != np.rint(truncated)).any():
        return ""
    shown = (bbox[:, 2] > bbox[:, 0]) & (bbox[:, 3] > bbox[:, 1])
    end = bbox[shown, 2:].max(0, initial=0.0)
    ends = (bbox[:, :2] < _EDGE_SHARE * end).any(1) | (bbox[:, 2:] > (1 - _EDGE_SHARE) * end).any(1)
    wrong = cut & ((truncated > 1) | (shown & ~ends))
    if 2 * wrong.sum() <= cut.sum():
        return ""
    return (
        "column 2 of the labels is no truncation: it holds only whole numbers, and "
        f"{int(wrong.sum())} of {int(cut.sum())} objects with 1 or more lie inside the image or have more than 1; "
        "truncation is not used"
    )


def parse_labels(text: str, source: str | Path = "labels") -> Labels:
    """The objects in the text of a label or detection file.

    Raises:
        FormatError: a line has not 15 (labels) or 16 (detections, with a score) columns, or another number
            than the lines before it; a value is not a number; `occluded` is not whole.
    """
    lines = [(number, line.split()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    rows, width = [], len(lines[0][1]) if lines else _COLUMNS
    for number, words in lines:
        where = f"{source}:{number}"
        if len(words) not in (_COLUMNS, _COLUMNS + 1):
            raise FormatError(f"{where}: {len(words)} columns; expected 15, or 16 with a score")
        if len(words) != width:
            raise FormatError(f"{where}: {len(words)} columns after lines of {width}; give all a score or none")
        row = numbers(words[1:], where)
        if row[1] != int(row[1]):
            raise FormatError(f"{where}: occluded is {words[2]}; expected a whole number, 0 to 3 or -1")
        rows.append(row)
    table = np.array(rows, np.float64).reshape(len(rows), width - 1)
    return Labels(
        type=tuple(words[0] for _, words in lines),
        truncated=table[:, 0],
        occluded=table[:, 1].astype(np.int64),
        alpha=table[:, 2],
        bbox=table[:, 3:7],
        dimensions=table[:, 7:10],
        location=table[:, 10:13],
        rotation_y=table[:, 13],
        score=table[:, 14] if width > _COLUMNS else None,
    )


def format_labels(labels: Labels, decimals: int = 2) -> str:
    """The text of a label file, with `decimals` places (KITTI: 2) and scores with 6.

    Raises:
        FormatError: a value is NaN or infinite, or a class name is empty or holds a blank.
    """
    lines = []
    for row, name in enumerate(labels.type):
        if len(name.split()) != 1 or name != name.strip():
            raise FormatError(f"labels: class name {name!r} must be one word")
        values = [labels.alpha[row], *labels.bbox[row], *labels.dimensions[row], *labels.location[row]]
        values = [labels.truncated[row], *values, labels.rotation_y[row]]
        if not np.isfinite(values).all():
            raise FormatError(f"labels: row {row} ({name}) holds NaN or infinity: {np.array(values)}")
        plain = name.lower() == DONT_CARE.lower()
        words = [f"{value:.{decimals}f}" for value in values]
        if plain:  # KITTI writes the placeholders of a DontCare region as integers
            words = [w if 2 <= i < 6 else f"{v:g}" for i, (w, v) in enumerate(zip(words, values, strict=True))]
        words[1:1] = [str(labels.occluded[row])]
        if labels.score is not None:
            words.append(f"{labels.score[row]:.6f}")
        lines.append(" ".join([name, *words]) + "\n")
    return "".join(lines)


def read_labels(path: str | Path) -> Labels:
    """Read a label or detection file; see `parse_labels`."""
    return parse_labels(read_text(path), path)


def write_labels(path: str | Path, labels: Labels, decimals: int = 2) -> None:
    """Write a label or detection file; see `format_labels`."""
    Path(path).write_text(format_labels(labels, decimals), encoding="utf-8", newline="\n")

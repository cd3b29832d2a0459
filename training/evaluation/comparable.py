"""Check whether labels and detections can be compared: class names, and boxes in the image.

KITTI's rules take an object's difficulty from its box in the image. Files without such boxes (zeros or −1 on one side)
are scored in 3D and in bird's-eye view only, with the height that each box would have in KITTI's own camera.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cosim.drives.kitti import Labels
from training.errors import EvaluationError
from training.evaluation.read import Scored, ScoreTable
from training.evaluation.rules import NEIGHBOURS

#: Types of KITTI's label files, in lower case.
TYPES = ("Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Cyclist", "Tram", "Misc", "DontCare")
_KNOWN = frozenset(name.lower() for name in TYPES)
_FOCAL_PX = 721.5377  # of KITTI's camera (P2 of 2011_09_26)
_FEWEST_POINTS = 5
_MOST = 0.5  # share of a class's boxes that decides whether its files have image boxes


def has_image_boxes(scored: Scored, name: str) -> bool:
    """Whether both labels and detections of a class have boxes in the image."""
    names = {name.lower(), (NEIGHBOURS.get(name) or name).lower()}
    of_class = np.isin(scored.labels.kind, list(names))
    detected = scored.detections.kind == name.lower()
    for table, rows in ((scored.labels, of_class), (scored.detections, detected)):
        if rows.any() and _has_box(table.objects)[rows].mean() < _MOST:
            return False
    return True


def heights(scored: Scored, name: str, points: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights in the image that determine the difficulty.

    Returns:
        (g,) height of each label [px], (d,) height of each detection [px], (g,) bool whether each label has enough
        points; all true if there are image boxes, or if points are unknown.
    """
    objects, detections = scored.labels.objects, scored.detections.objects
    if has_image_boxes(scored, name):
        label_height, detection_height = (
            objects.bbox[:, 3] - objects.bbox[:, 1],
            np.abs(detections.bbox[:, 3] - detections.bbox[:, 1]),
        )
        return label_height, detection_height, np.ones(len(label_height), bool)
    has_enough_points = np.ones(len(objects), bool) if points is None else points >= _FEWEST_POINTS
    return _projected_height(objects), _projected_height(detections), has_enough_points


def without_image_rules(has_points: bool) -> str:
    """Sentence that describes how the difficulty was determined."""
    by = f" and holds {_FEWEST_POINTS} points or more" if has_points else ""
    return (
        "labels or detections have no boxes in the image: 3D and bird's-eye view are scored without the image rules; "
        f"an object counts where its height at its distance is tall enough in KITTI's camera{by}"
    )


def demand_comparable_classes(scored: Scored, classes: Sequence[str]) -> None:
    """Check that labels and detections have common class names.

    Raises:
        EvaluationError: a scored class is on one side only, and the other side has names that KITTI does not know.
    """
    sides = {"labels": Counter(scored.labels.kind.tolist()), "detections": Counter(scored.detections.kind.tolist())}
    wanted = [name.lower() for name in classes]
    unknown = {side: [kind for kind in counts if kind not in _KNOWN] for side, counts in sides.items()}
    for side, other_side in (("labels", "detections"), ("detections", "labels")):
        missing = [name for name in wanted if sides[other_side][name] and not sides[side][name]]
        both = any(sides["labels"][name] and sides["detections"][name] for name in wanted)
        if unknown[side] and (missing or not both):
            label = next((name for name in classes if name.lower() in missing), classes[0])
            raise EvaluationError(
                f"{side} contain {_list_classes(scored, side)}, {other_side} {_list_classes(scored, other_side)}: "
                f"{', '.join(unknown[side])} is no class of KITTI; map it to a KITTI class, for example --classes "
                f"{_class_name(scored, side, unknown[side][0])}={label}"
            )


def unscored_classes(scored: Scored) -> list[str]:
    """Names, as in the files, of classes that KITTI does not know."""
    tables = (scored.labels, scored.detections)
    names = {kind: name for table in tables for kind, name in zip(table.kind, table.objects.type, strict=True)}
    return sorted(name for kind, name in names.items() if kind not in _KNOWN)


def parse_classes(texts: Sequence[str]) -> dict[str, str]:
    """`["Vehicle=Car", "Bike=Cyclist,Person=Pedestrian"]` as a mapping from lower-case names to KITTI's.

    Raises:
        EvaluationError: no `=`, or an unknown class on its right.
    """
    mapping = {}
    for pair in (part for text in texts for part in text.split(",") if part):
        old, equals, new = pair.partition("=")
        target = next((name for name in TYPES if name.lower() == new.strip().lower()), None)
        if not equals or not old.strip() or target is None:
            raise EvaluationError(
                f"--classes {pair}: give NAME=CLASS with one of {', '.join(TYPES)}, for example Vehicle=Car"
            )
        mapping[old.strip().lower()] = target
    return mapping


def rename_classes(scored: Scored, names: Mapping[str, str]) -> Scored:
    """Rename classes.

    Raises:
        EvaluationError: a name is in neither the labels nor the detections.
    """
    known_names = {*scored.labels.kind.tolist(), *scored.detections.kind.tolist()}
    for old in names:
        if old not in known_names:
            raise EvaluationError(
                f"--classes {old}={names[old]}: the files contain {', '.join(sorted(known_names))}; give one of them"
            )

    def rename_table(table: ScoreTable) -> ScoreTable:
        types = tuple(names.get(kind, name) for kind, name in zip(table.kind, table.objects.type, strict=True))
        kind = np.array([name.lower() for name in types], dtype=str)
        return replace(table, objects=replace(table.objects, type=types), kind=kind)

    return replace(scored, labels=rename_table(scored.labels), detections=rename_table(scored.detections))


def _has_box(objects: Labels) -> np.ndarray:
    """(n,) bool objects with an image box of positive area."""
    return (objects.bbox[:, 2] > objects.bbox[:, 0]) & (objects.bbox[:, 3] > objects.bbox[:, 1])


def _projected_height(objects: Labels) -> np.ndarray:
    """Height (n,) [px] of boxes with the same height and distance in KITTI's camera."""
    distance = np.hypot(objects.location[:, 0], objects.location[:, 2])
    return _FOCAL_PX * objects.dimensions[:, 0] / np.maximum(distance, 1.0)


def _list_classes(scored: Scored, side: str) -> str:
    table: ScoreTable = getattr(scored, side)
    counts = Counter(table.objects.type)
    return ", ".join(f"{name} ({count})" for name, count in counts.most_common(8)) or "nothing"


def _class_name(scored: Scored, side: str, kind: str) -> str:
    table: ScoreTable = getattr(scored, side)
    return table.objects.type[table.kind.tolist().index(kind)]

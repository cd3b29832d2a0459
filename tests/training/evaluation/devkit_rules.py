"""KITTI's scoring written out as plain loops over one object at a time, polygons by shapely: slow and obvious."""

from __future__ import annotations

import math

import numpy as np
from shapely import Polygon

MIN_HEIGHT, MAX_OCCLUSION, MAX_TRUNCATION = (40, 25, 25), (0, 1, 2), (0.15, 0.3, 0.5)
MIN_OVERLAP = {"car": 0.7, "pedestrian": 0.5, "cyclist": 0.5}
NEIGHBOUR = {"car": "van", "pedestrian": "person_sitting", "cyclist": None}


def image_overlap(a, b, share_of_a=False):
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    area_a, area_b = (a[2] - a[0]) * (a[3] - a[1]), (b[2] - b[0]) * (b[3] - b[1])
    shared = width * height
    return shared / area_a if share_of_a else shared / (area_a + area_b - shared)


def footprint(labels, row):
    _, width, length = labels.dimensions[row]
    x, _, z = labels.location[row]
    c, s = math.cos(labels.rotation_y[row]), math.sin(labels.rotation_y[row])
    corners = [(length / 2, width / 2), (length / 2, -width / 2), (-length / 2, -width / 2), (-length / 2, width / 2)]
    return Polygon([(c * a + s * b + x, -s * a + c * b + z) for a, b in corners])


def overlap(metric, detections, j, labels, i):
    if metric == "2d":
        return image_overlap(detections.bbox[j], labels.bbox[i])
    own, theirs = footprint(labels, i), footprint(detections, j)
    shared = own.intersection(theirs).area
    if metric == "bev":
        return shared / (own.area + theirs.area - shared)
    bottom = min(detections.location[j, 1], labels.location[i, 1])
    top = max(d.location[r, 1] - d.dimensions[r, 0] for d, r in ((detections, j), (labels, i)))
    volume = shared * max(0.0, bottom - top)
    return volume / (detections.dimensions[j].prod() + labels.dimensions[i].prod() - volume)


def states(cls, labels, detections, level):
    of_labels = []
    for i in range(len(labels)):
        kind = labels.type[i].lower()
        hard = labels.occluded[i] > MAX_OCCLUSION[level] or labels.truncated[i] > MAX_TRUNCATION[level]
        hard = hard or labels.bbox[i, 3] - labels.bbox[i, 1] <= MIN_HEIGHT[level]
        if kind == cls:
            of_labels.append(1 if hard else 0)
        else:
            of_labels.append(1 if kind == NEIGHBOUR[cls] else -1)
    of_detections = []
    for j in range(len(detections)):
        if abs(detections.bbox[j, 3] - detections.bbox[j, 1]) < MIN_HEIGHT[level]:
            of_detections.append(1)
        else:
            of_detections.append(0 if detections.type[j].lower() == cls else -1)
    return of_labels, of_detections


def statistics(cls, metric, level, labels, detections, threshold, overlaps):
    of_labels, of_detections = states(cls, labels, detections, level)
    assigned = [False] * len(detections)
    below = [threshold is not None and detections.score[j] < threshold for j in range(len(detections))]
    tp = fp = fn = 0
    similarity, scores = 0.0, []
    for i in range(len(labels)):
        if of_labels[i] == -1:
            continue
        best, best_overlap, best_score, best_is_small = -1, 0.0, -1e7, False
        for j in range(len(detections)):
            if of_detections[j] == -1 or assigned[j] or below[j] or overlaps[i][j] <= MIN_OVERLAP[cls]:
                continue
            if threshold is None:
                if detections.score[j] > best_score:
                    best, best_score = j, detections.score[j]
            elif of_detections[j] == 0 and (overlaps[i][j] > best_overlap or best_is_small):
                best, best_overlap, best_is_small = j, overlaps[i][j], False
            elif of_detections[j] == 1 and best == -1:
                best, best_is_small = j, True
        if best == -1:
            fn += of_labels[i] == 0
            continue
        assigned[best] = True
        if of_labels[i] == 0 and of_detections[best] == 0:
            tp += 1
            scores.append(detections.score[best])
            similarity += (1 + math.cos(labels.alpha[i] - detections.alpha[best])) / 2
    for j in range(len(detections)):
        if of_detections[j] == 0 and not assigned[j] and not below[j]:
            regions = [i for i in range(len(labels)) if labels.type[i].lower() == "dontcare"] if metric == "2d" else []
            shares = [image_overlap(detections.bbox[j], labels.bbox[i], True) for i in regions]
            fp += not any(share > MIN_OVERLAP[cls] for share in shares)
    return tp, fp, fn, similarity, scores


def thresholds(scores, objects):
    scores, chosen, current = sorted(scores, reverse=True), [], 0.0
    for i, score in enumerate(scores):
        left = (i + 1) / objects
        right = (i + 2) / objects if i < len(scores) - 1 else left
        if right - current < current - left and i < len(scores) - 1:
            continue
        chosen.append(score)
        current += 1 / 40
    return chosen


def average_precisions(cls, metric, level, frames):
    """(R40, R11, AOS R40, AOS R11) in percent of frames [(labels, detections), …]."""
    overlaps = [
        [[overlap(metric, d, j, g, i) for j in range(len(d))] if g.type[i].lower() != "dontcare" else [0] * len(d)
         for i in range(len(g))]
        for g, d in frames
    ]  # fmt: skip
    scores, objects = [], 0
    for (labels, detections), over in zip(frames, overlaps, strict=True):
        scores += statistics(cls, metric, level, labels, detections, None, over)[4]
        objects += states(cls, labels, detections, level)[0].count(0)
    precision, aos = np.zeros(41), np.zeros(41)
    for slot, threshold in enumerate(thresholds(scores, objects)):
        sums = np.zeros(4)
        for (labels, detections), over in zip(frames, overlaps, strict=True):
            sums += statistics(cls, metric, level, labels, detections, threshold, over)[:4]
        if sums[0] + sums[1]:
            precision[slot], aos[slot] = sums[0] / (sums[0] + sums[1]), sums[3] / (sums[0] + sums[1])
    for curve in (precision, aos):
        for slot in range(41):
            curve[slot] = curve[slot:].max()
    return [100 * value for curve in (precision, aos) for value in (curve[1:].sum() / 40, curve[::4].sum() / 11)]

"""SemanticKITTI's class of every point: by the material its beam met, and by whose box it lies in."""

from __future__ import annotations

import numpy as np

from assets.materials import MATERIAL_NAMES
from cosim.drives.kitti import Drive, Frame
from cosim.export.source import ExportError
from sensors.hits_file import load_hits
from sensors.pattern import load_pattern

UNLABELED, OUTLIER = 0, 1
_STATIC = {
    40: ("asphalt", "asphalt_patch", "manhole", "gravel", "rail"),
    48: ("kerb", "paving", "cobble"),
    60: ("road_marking",),
    50: (
        *("plaster_white", "plaster_yellow", "plaster_grey", "plaster_red", "brick", "concrete", "stone"),
        *("cladding_metal", "roof_tile", "roof_slate", "roof_flat", "window_frame", "window_glass", "room_interior"),
        "door",
    ),
    51: ("wood",),
    70: ("foliage", "foliage_dark", "hedge"),
    71: ("bark",),
    72: ("grass", "soil"),
    80: ("steel_galvanised", "steel_painted"),
    81: (
        *("sign_face", "sign_back", "sign_red", "sign_blue", "sign_yellow", "sign_black"),
        *("signal_housing", "signal_lens"),
    ),
}
_OTHER_OBJECT = 99
# kind → class standing, class moving
_MOVING = {
    "car": (10, 252),
    "van": (10, 252),
    "truck": (18, 258),
    "bus": (13, 257),
    "tram": (16, 256),
    "motorcycle": (15, 255),
    "cyclist": (31, 253),
    "pedestrian": (30, 254),
    "person_sitting": (30, 254),
}
_STANDS_MPS = 0.1
_AWAY_M = 0.5  # a point farther than this from what its beam meets is not of it


def point_classes(drive: Drive, frame: Frame, within: np.ndarray) -> np.ndarray:
    """Classes (n,) of a frame's points, numbered as in semantic-kitti.yaml.

    A point far from the static surface that its beam hits, and in no box, is an outlier: rain, a ghost.

    Args:
        drive: drive with a pattern, to identify beams.
        frame: with stored hits.
        within: (n,) row of the twin's instance in whose box a point lies, −1 for none.

    Raises:
        ExportError: the drive's pattern is unknown, or hits and pattern do not match.
    """
    if drive.pattern is None:
        raise ExportError(f"{drive.root}: no pattern.yaml, so beams are not known; add the pattern")
    rays = load_pattern(drive.pattern).rays()
    hits = load_hits(frame.hits_path, rays)
    beam = _beams(frame, rays.ring, rays.time_s)
    classes = _class_of_material()[hits.solid.material[beam]]
    range_m = np.linalg.norm(frame.points[:, :3], axis=1)
    classes[np.abs(range_m - hits.solid.range_m[beam]) > _AWAY_M] = OUTLIER
    for row in np.unique(within[within >= 0]):
        thing = frame.twin.instances[int(row)]
        still, moves = _MOVING.get(thing.kind, (_OTHER_OBJECT, _OTHER_OBJECT))
        classes[within == row] = moves if np.linalg.norm(thing.velocity_mps) > _STANDS_MPS else still
    return classes


def _beams(frame: Frame, ring: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Row of the pattern's beam that each point came from (n,): of its ring, the nearest in time."""
    apart = 4 * max(float(np.abs(time_s).max()), float(np.abs(frame.rays.time_s).max(initial=0)), 1e-3)
    order = np.lexsort([time_s, ring])
    key = ring[order].astype(np.float64) * apart + time_s[order]
    wanted = frame.rays.ring.astype(np.float64) * apart + frame.rays.time_s
    at = np.clip(np.searchsorted(key, wanted), 1, len(key) - 1)
    nearer = np.where(np.abs(key[at - 1] - wanted) < np.abs(key[at] - wanted), at - 1, at)
    return order[nearer]


def _class_of_material() -> np.ndarray:
    table = np.full(256, _OTHER_OBJECT)
    for number, names in _STATIC.items():
        for name in names:
            table[MATERIAL_NAMES.index(name)] = number
    return table

"""Semantic class of each pixel, as in the Cityscapes and KITTI semantic benchmarks.

Classes follow from the material of a face and, on what can move, from its kind. Materials serve many things: a
garden wall of stone is `building`, a steel fence `pole`. Glass is not drawn: a window has the class of what shows
through it, save in the distance, where panes are drawn dark and belong to their vehicle.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np

from assets.materials import MATERIAL_NAMES, material_index
from sensors.cameras.images import Images

CLASSES = MappingProxyType(
    {
        "static": 4,
        "road": 7,
        "sidewalk": 8,
        "building": 11,
        "pole": 17,
        "traffic_light": 19,
        "traffic_sign": 20,
        "vegetation": 21,
        "terrain": 22,
        "sky": 23,
        "person": 24,
        "rider": 25,
        "car": 26,
        "truck": 27,
        "bus": 28,
        "train": 31,
        "motorcycle": 32,
        "bicycle": 33,
    }
)
"""Cordts et al., The Cityscapes Dataset, CVPR 2016: label ids. A van is a car there, a tram a train."""

MATERIAL_CLASSES = MappingProxyType(
    {
        "road": ("asphalt", "asphalt_patch", "road_marking", "manhole", "rail"),
        "sidewalk": ("kerb", "paving", "cobble"),
        "terrain": ("gravel", "grass", "soil"),
        "building": (
            *("plaster_white", "plaster_yellow", "plaster_grey", "plaster_red", "brick", "concrete", "stone"),
            *("cladding_metal", "roof_tile", "roof_slate", "roof_flat", "window_frame", "window_glass"),
            *("room_interior", "door"),
        ),
        "vegetation": ("bark", "foliage", "foliage_dark", "hedge"),
        "pole": ("steel_galvanised", "steel_painted"),
        "traffic_sign": ("sign_face", "sign_back", "sign_red", "sign_blue", "sign_yellow", "sign_black"),
        "traffic_light": ("signal_housing", "signal_lens", "lamp_red", "lamp_amber", "lamp_green"),
    }
)
"""Materials of the static world by class; all others are `static`."""

KIND_CLASSES = MappingProxyType(
    {
        "car": "car",
        "van": "car",
        "truck": "truck",
        "bus": "bus",
        "tram": "train",
        "motorcycle": "motorcycle",
        "cyclist": "bicycle",
        "pedestrian": "person",
        "person_sitting": "person",
    }
)
_RIDDEN = ("motorcycle", "cyclist")
_RIDERS = ("skin", "hair", "clothing", "clothing_dark", "shoe", "helmet")


def semantic_image(images: Images, types: tuple[str, ...]) -> np.ndarray:
    """Class of every pixel, (h, w) uint8 out of `CLASSES`.

    Args:
        images: of one camera.
        types: of the instances it was drawn with.
    """
    classes = _class_of_material()[images.material]
    moving = np.flatnonzero(images.instance)
    row = images.instance.ravel()[moving].astype(np.int64) - 1
    of_kind = np.array([CLASSES[KIND_CLASSES[kind]] for kind in types], np.uint8)
    found = of_kind[row]
    ridden = np.array([kind in _RIDDEN for kind in types], bool)
    rider = ridden[row] & _is_rider()[images.material.ravel()[moving]]
    classes.ravel()[moving] = np.where(rider, np.uint8(CLASSES["rider"]), found)
    return classes


def _class_of_material() -> np.ndarray:
    """By the number a pixel holds: 0 the sky, k + 1 material row k."""
    table = np.full(256, CLASSES["static"], np.uint8)
    table[0] = CLASSES["sky"]
    for name, materials in MATERIAL_CLASSES.items():
        table[[material_index(material) + 1 for material in materials]] = CLASSES[name]
    return table


def _is_rider() -> np.ndarray:
    table = np.zeros(256, bool)
    table[1 : len(MATERIAL_NAMES) + 1] = [name in _RIDERS for name in MATERIAL_NAMES]
    return table

"""Weights trained with OpenPCDet or mmdetection3d, under cosim's parameter names.

OpenPCDet has the same names. mmdetection3d has other names and no padding layer at the start of a stage,
orders KITTI's classes Pedestrian, Cyclist, Car, and its first half-turn starts at −90°.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from training.models.anchors import HEADINGS_RAD
from training.models.pillar_encoder import FEATURES

_WRAPPERS = ("model_state", "state_dict", "model", "weights")
_NOT_WEIGHTS = ("global_step",)
_THEIR_CLASSES = ("Pedestrian", "Cyclist", "Car")
_RENAMED = (
    (r"^voxel_encoder\.pfn_layers\.", "vfe.pfn_layers."),
    (r"^neck\.deblocks\.", "backbone_2d.deblocks."),
    (r"^bbox_head\.conv_cls\.", "dense_head.conv_cls."),
    (r"^bbox_head\.conv_reg\.", "dense_head.conv_box."),
    (r"^bbox_head\.conv_dir_cls\.", "dense_head.conv_dir_cls."),
)
_PILLAR_WEIGHT = "vfe.pfn_layers.0.linear.weight"


@dataclass(frozen=True, eq=False)
class TranslatedWeights:
    """Weights under cosim's names, and the heading at which their first half-turn starts [rad]."""

    weights: dict[str, Tensor]
    direction_offset_rad: float


def translate(content: Mapping[str, Any], classes: Sequence[str]) -> TranslatedWeights:
    """Convert the weights of a checkpoint of another framework.

    Args:
        content: content of the file.
        classes: classes in the order of cosim's anchors.
    """
    for key in _WRAPPERS:
        if isinstance(content.get(key), Mapping):
            content = content[key]
            break
    weights = {str(key).removeprefix("module."): value for key, value in content.items() if isinstance(value, Tensor)}
    weights = {key: value for key, value in weights.items() if key not in _NOT_WEIGHTS}
    is_mmdetection3d = any(key.startswith("bbox_head.") for key in weights)
    if is_mmdetection3d:
        weights = _reorder_classes({_rename_key(key): value for key, value in weights.items()}, classes)
    pillar = weights.get(_PILLAR_WEIGHT)
    if pillar is not None and pillar.shape[1] == FEATURES - 1:  # without the vertical offset from the pillar's centre
        weights[_PILLAR_WEIGHT] = torch.cat([pillar, pillar.new_zeros(len(pillar), 1)], 1)
    return TranslatedWeights(weights, -math.pi / 2 if is_mmdetection3d else 0.78539)


def _rename_key(key: str) -> str:
    stage = re.match(r"^backbone\.blocks\.(\d+)\.(\d+)\.(.+)$", key)
    if stage:
        return f"backbone_2d.blocks.{stage[1]}.{int(stage[2]) + 1}.{stage[3]}"
    for pattern, replacement in _RENAMED:
        key = re.sub(pattern, replacement, key)
    return key


def _reorder_classes(weights: dict[str, Tensor], classes: Sequence[str]) -> dict[str, Tensor]:
    """Reorder the channels of the head to cosim's class order, if the sets of classes are equal."""
    if sorted(classes) != sorted(_THEIR_CLASSES):
        return weights
    order = torch.tensor([_THEIR_CLASSES.index(name) for name in classes])
    reordered = dict(weights)
    for part in ("conv_cls", "conv_box", "conv_dir_cls"):
        for kind in ("weight", "bias"):
            name = f"dense_head.{part}.{kind}"
            value = weights.get(name)
            each = len(classes) * len(HEADINGS_RAD)
            if value is None or len(value) % each:
                continue
            grouped = value.reshape(len(classes), len(HEADINGS_RAD), len(value) // each, *value.shape[1:])[order]
            if part == "conv_cls" and grouped.shape[2] == len(classes):
                grouped = grouped[:, :, order]
            reordered[name] = grouped.reshape(value.shape)
    return reordered
